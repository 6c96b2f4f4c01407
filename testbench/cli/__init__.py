"""The bench's verbs of `p2os`: thin skins on functions that scripts can call."""
