"""The C library under the emulator: its sources, how it is loaded, and the structs that it shares with Python."""
