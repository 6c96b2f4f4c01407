"""The bodies that a controller moves: one contract, three engines."""
