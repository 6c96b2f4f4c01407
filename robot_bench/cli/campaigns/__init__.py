"""Verbs that judge by many runs: of wrong programs, and of ever smaller failures."""
