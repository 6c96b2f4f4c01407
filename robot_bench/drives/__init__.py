"""Drives out of runs and packets, and the figures of one: `metrics`, with the latency budget of its loop.

`drive` is what was driven, `of_packets` and `of_run` where it comes from; files of other programs are read by
`robot_bench.experiments.drive_files`. Needs NumPy (extra `experiments`, and `sim`).
"""
