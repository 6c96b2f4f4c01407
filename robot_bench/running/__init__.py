"""How virtual time goes on: the run loop of one chip, several of them in one world, and real time."""
