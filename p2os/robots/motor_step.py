"""The speed that one step of a three-bit motor value asks of a wheel, where nobody says otherwise.

The adapter and mode A drive by it, a node of ROS 2 publishes by it, and a report reads a run by it whose trace does not
tell. Four steps are 250 mm/s, and so is a full duty.
"""

#: Of the rim, µm/s and m/s.
STEP_UM_PER_S = 62_500
STEP_MPS = STEP_UM_PER_S / 1e6
