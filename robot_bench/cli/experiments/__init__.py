"""The verbs that experiments are made with."""
