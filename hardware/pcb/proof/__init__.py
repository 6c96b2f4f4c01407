"""Proof that the circuit is the one that is meant: expected connections, and wrong circuits to be noticed."""
