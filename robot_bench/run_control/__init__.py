"""A run that is halted, stepped, set back and forked: its machine for a debugger, futures, commands of the page."""
