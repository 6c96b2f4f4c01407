"""The debugger: GDB's remote serial protocol in front of an emulated chip; and two cores side by side."""
