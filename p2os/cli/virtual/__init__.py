"""Verbs for the virtual robot: serve it, and its worlds."""
