"""A running bench as a node of ROS 2, so that a firmware meets ROS at its pins, as in the thesis.

`bench_node` says what becomes of what, `recorded` finds in a trace what came in, `drive` moves both.
"""
