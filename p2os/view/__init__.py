"""The page of a run, a capture or a robot: what it shows as channels, in a file of its own or served on loopback."""
