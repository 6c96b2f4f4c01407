"""`p2os mcu compare-…`: the model beside something else that runs the same program."""
