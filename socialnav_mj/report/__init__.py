"""One run: what its episodes come to, as tables, estimates, figures and a page; `writer` makes them all."""
