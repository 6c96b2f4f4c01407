"""Analysis of a running firmware: coverage, profile, trace, stack, latency, waveforms.

Nothing here disturbs the run: with or without it a program takes the same cycles.
"""
