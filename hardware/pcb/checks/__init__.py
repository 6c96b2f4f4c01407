"""Every check of the board, and the table of verdicts."""
