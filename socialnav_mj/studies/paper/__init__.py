"""The paper's study: `plan` says what is run, `outputs` makes tables, figures and pages of its episodes."""
