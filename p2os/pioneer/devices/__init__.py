"""What is mounted on a Pioneer beside its wheels and sonar: one passive device a file.

Each device is a record of plain values: it reads no clock, and a copy of it is
its snapshot. `fitted` holds all of one robot.
"""
