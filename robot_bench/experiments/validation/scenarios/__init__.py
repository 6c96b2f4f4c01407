"""Scenarios of experiments, with their worlds and robots."""
