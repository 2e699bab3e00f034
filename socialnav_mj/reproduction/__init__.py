"""The paper's experiment, from its settings to its claims: `plan` runs the episodes, `outputs` makes the rest."""
