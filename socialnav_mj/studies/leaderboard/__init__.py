"""Every controller on every recording, with ranks as sure as the draws allow; study runs it and writes."""
