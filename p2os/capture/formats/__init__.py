"""Files and texts that hold P2OS bytes, each read as a capture, and files that other programs read."""
