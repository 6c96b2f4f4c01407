"""A robot with two driven wheels on a firmware engineer's own pins.

PWM through an H-bridge to a DC motor with gear, a quadrature encoder on each wheel, a battery that sags, analog
distance sensors and bumpers. A TOML file describes it; docs/own-robot.md lists every key.
"""
