"""The native core: the hot part of the chip in C (`source/`), and its Python side."""
