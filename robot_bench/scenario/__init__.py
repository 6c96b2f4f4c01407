"""A scenario file: which program, in which world, what happens, and what is wanted."""
