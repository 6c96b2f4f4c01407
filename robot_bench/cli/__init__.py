"""The bench's verbs of `p2os`: thin layers over functions that scripts can call."""
