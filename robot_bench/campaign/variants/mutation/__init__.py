"""Mutation of a firmware: how many wrong programs the goals of some scenarios notice."""
