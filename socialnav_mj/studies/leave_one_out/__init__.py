"""Policies on the recording that they did not learn from, beside the others; `study` runs it and writes."""
