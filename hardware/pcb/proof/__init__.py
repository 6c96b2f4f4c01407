"""Proof that the circuit is the one that is meant: an expected table of its own, and wrong circuits that must be noticed."""
