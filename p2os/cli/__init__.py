"""The command `p2os VERB`: a thin layer over functions that scripts can call."""
