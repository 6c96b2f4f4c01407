"""What the page shows of a run on the bench: its events as channels, its report as sections."""
