"""Virtual robots on real lines, in real or scaled time: one host, or a fleet in one world."""
