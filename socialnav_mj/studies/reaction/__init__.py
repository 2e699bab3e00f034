"""What a result of replay is worth if people react: every controller at three strengths; study runs it and writes."""
