"""The command `p2os VERB`: a thin skin on functions that scripts can call."""
