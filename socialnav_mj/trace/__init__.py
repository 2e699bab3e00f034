"""Episode -> rerun recording, to be looked at; `writer` makes it."""
