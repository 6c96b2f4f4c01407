"""Verbs for one robot at a line: who it is, drive it, send to it, watch it."""
