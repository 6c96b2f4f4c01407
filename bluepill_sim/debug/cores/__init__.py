"""Two cores that run one firmware side by side, and the first place where they differ."""
