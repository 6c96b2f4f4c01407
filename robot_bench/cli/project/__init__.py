"""A project of the user's own: the files that `p2os new` writes."""
