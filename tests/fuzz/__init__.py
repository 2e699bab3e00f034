"""Hostile inputs for everything that reads a file: `python -m tests.fuzz.run --seconds 60`."""
