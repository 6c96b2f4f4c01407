"""A failing run made as small and as round as it can be, and what it is kept as."""
