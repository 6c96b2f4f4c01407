"""What can be seen of a running firmware: coverage, profile, trace, stack, latency, waveforms.

Everything here looks on: with or without it a program runs the same cycles.
"""
