"""Social navigation in recorded crowds, as a MuJoCo physics benchmark."""
