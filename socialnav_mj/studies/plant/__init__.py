"""What physics changes: every controller on four plants, an ideal unicycle among them; study runs it and writes."""
