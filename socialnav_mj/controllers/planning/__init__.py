"""What planning controllers are made of: the crowd to come, the cost of a plan, and the search for a good one."""
