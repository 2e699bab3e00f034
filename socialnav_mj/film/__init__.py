"""Episode -> film or picture in MuJoCo's drawing, from the record alone; film makes it."""
