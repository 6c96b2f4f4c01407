"""The P2OS protocol without a line and without a clock: frames, commands, packets, and both ends of a connection."""
