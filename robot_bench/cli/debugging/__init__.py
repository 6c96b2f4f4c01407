"""A bench under GDB: the machine that a debugger sees, and the server that waits for one."""
