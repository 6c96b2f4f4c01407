"""The scenarios that ship, and beside them the goals that know what one of their programs prints."""
