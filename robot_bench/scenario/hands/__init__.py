"""What is done to a run by hand: its tables, its times, its words."""
