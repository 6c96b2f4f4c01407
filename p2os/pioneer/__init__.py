"""The virtual Pioneer: its controller, devices, body and sonar, the worlds it drives in, and what serves it.

`controller` is the robot's firmware, `devices` what is fitted to it, `body` its motion
(three engines), `sonar` its ring, `world` the places it drives in, `export` writes both
for other programs, `serve` puts robots on real lines. `sensor_errors` holds every number
of how the sensors err, `random_source` the seeded streams behind them.
"""
