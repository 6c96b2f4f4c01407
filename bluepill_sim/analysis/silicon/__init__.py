"""The silicon kit: a program that asks a real STM32F103C8 what it does, and the comparison of its log with the model.

`kit.c` is built into `kit.elf` by robot_bench/firmware/build.py. Nobody here has a board; docs/silicon.md says so.
"""
