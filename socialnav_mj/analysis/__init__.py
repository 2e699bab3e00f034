"""What is made of episodes: statistics, tables, the report and the trace."""
