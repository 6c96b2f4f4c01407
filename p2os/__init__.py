"""The P2OS protocol: wire, commands, packets, connection, client and virtual robot."""
