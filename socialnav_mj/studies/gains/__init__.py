"""Where both forms of the potential field stand in the range of their gains; study runs it and writes."""
