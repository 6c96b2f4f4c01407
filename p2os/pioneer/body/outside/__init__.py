"""A body that another program moves: the client of a lock-step protocol over a socket (docs/outside-body.md)."""
