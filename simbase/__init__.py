"""What every model stands on: the contract for time, declared state, and the root of the errors.

It knows nothing of chips, robots or protocols, and imports the standard library only.
"""
