"""Verbs for the line to a robot: its ports, a search, and a measurement."""
