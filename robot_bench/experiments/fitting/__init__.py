"""A robot's parameters out of drives: wheels, ramps and sonar by least squares, UMBmark, files of what was found."""
