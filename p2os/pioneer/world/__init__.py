"""The places a robot can be in: what a world is, its files, makers, plan and drawings."""
