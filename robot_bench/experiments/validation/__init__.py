"""Experiments of the bench on itself: the validations of motors, sensors, encoders and a whole drive, in figures.

What is claimed, run and measured stands in `experiments`; what the bench should do by its settings in `nominal`; a
measured value beside its expected one, with the bound of their difference, is a figure.
"""
