"""A bench that is halted, stepped, set back and forked, by GDB or from its page: its machine, and who runs it."""
