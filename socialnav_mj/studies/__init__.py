"""Questions that take many runs, a folder each; here is what they share."""
