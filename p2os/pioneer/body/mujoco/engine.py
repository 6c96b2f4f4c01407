"""The settings of MuJoCo's solver.

MuJoCo's contacts and joint frictions are soft by default: a robot on them turns
0.7 degrees short. The settings below make them as good as rigid, as far as steps
of 1 ms allow. Measured: a line of 1 m comes out within 0.02 mm, a full turn within
0.0004 degrees.
"""

import mujoco

from p2os.pioneer.body.contract import STEP_NS
from p2os.pioneer.body.physical import GRAVITY_MPS2
from simbase.timing import NS_PER_S

#: Stiffness and damping of a contact, 1/s² and 1/s, in MuJoCo's direct form (negative). What has come into another
#: is eased out at 10 /s. Stiffer (measured: ten times) flings a robot away that was put into a thing, and with twice
#: the damping a hull that is pressed against a wall bounces off it.
CONTACT_SOLREF = (-5000.0, -500.0)
#: A motor reaches its set-point within one step, if its torque allows.
MOTOR_SOLREF = (0.0, -NS_PER_S / STEP_NS)
#: The share of a constraint that is held, whatever the depth: MuJoCo's greatest.
RIGID_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
#: chosen: the solver ends at the first of both; Newton's method needs some three rounds.
ITERATIONS, TOLERANCE = 100, 1e-10


def new_spec() -> mujoco.MjSpec:
    """Return an empty description of a world with this project's settings."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep = STEP_NS / NS_PER_S
    option.gravity = [0.0, 0.0, -GRAVITY_MPS2]
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.iterations, option.tolerance = ITERATIONS, TOLERANCE
    # What has gone wrong must be seen, not begun anew in silence.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    geometry = spec.default.geom
    geometry.solref, geometry.solimp = list(CONTACT_SOLREF), list(RIGID_SOLIMP)
    return spec
