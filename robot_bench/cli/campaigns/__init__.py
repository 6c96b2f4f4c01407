"""Verbs that judge by many runs: campaigns, mutants of a firmware, failures made small."""
