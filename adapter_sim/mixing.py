"""Motor values and a pad's deflections to VEL and RVEL, in integers.

With `MotorMeaning.WHEELS` the two values are rim speeds of a differential
drive: v = (left + right) / 2, ω = (right − left) / track. VEL takes whole mm/s
and RVEL whole deg/s; both are rounded half away from zero, so a command and its
mirror image stay mirror images. The rounding of RVEL is worth up to
half a degree a second: 1.6 mm/s at each rim with a track of 357 mm.

Where a speed is over its limit both are scaled by the same factor (towards
zero), so that the robot keeps its path and only takes longer.

Invariant: what leaves here is within the robot's limits and those of the settings.
"""

from dataclasses import dataclass

from adapter_sim.codec import divide_half_away
from adapter_sim.duty import FULL
from adapter_sim.settings import AdapterSettings, MotorCommand, MotorMeaning
from p2os.gamepad import STICK_FULL, TRIGGER_FULL

#: 180/π, in 1e-9.
DEG_PER_RAD_E9 = 57_295_779_513


@dataclass(frozen=True, slots=True)
class CommandedSpeeds:
    """What is commanded: forward mm/s and deg/s to the left."""

    forward_mm_s: int
    turn_deg_s: int


#: Standing still.
STILL = CommandedSpeeds(0, 0)


class Mixer:
    """Turns a pair of motor values into speeds; it has no state.

    Args:
        settings: Meaning and step sizes.
        full_steps: Steps that a full duty stands for: as many as the lowest value of the motor bits.
        track_mm: Distance between the wheels, from the robot file.
        max_velocity_mm_s: The robot's own limit; the settings may lower it.
        max_rotation_deg_s: Likewise.
    """

    def __init__(
        self,
        settings: AdapterSettings,
        *,
        full_steps: int,
        track_mm: int,
        max_velocity_mm_s: int,
        max_rotation_deg_s: int,
    ) -> None:
        self.track_mm = track_mm
        self.max_velocity_mm_s = _lower(max_velocity_mm_s, settings.max_velocity_mm_s)
        self.max_rotation_deg_s = _lower(max_rotation_deg_s, settings.max_rotation_deg_s)
        self._meaning = settings.motor_meaning
        is_duty = settings.motor_command is MotorCommand.DUTY
        self._steps, self._per = (full_steps, FULL) if is_duty else (1, 1)
        self._step_um_per_s = settings.step_um_per_s
        self._angular_step_urad_per_s = settings.angular_step_urad_per_s
        self._pad_velocity_mm_s = settings.pad_velocity_mm_s
        self._pad_rotation_mrad_s = settings.pad_rotation_mrad_s

    def mix(self, motor1: int, motor2: int) -> CommandedSpeeds:
        """Return the speeds that a pair of signed motor values asks for: steps, or duties of `FULL`."""
        first = self._of_steps(motor1, self._step_um_per_s)
        if self._meaning is MotorMeaning.WHEELS:
            second = self._of_steps(motor2, self._step_um_per_s)
            forward = divide_half_away(first + second, 2_000)
            # µm/s over µm of track are rad/s; 1e-9 of DEG_PER_RAD_E9 and 1e3 of mm.
            turn = divide_half_away((second - first) * DEG_PER_RAD_E9, self.track_mm * 1_000 * 10**9)
        else:
            second = self._of_steps(motor2, self._angular_step_urad_per_s)
            forward = divide_half_away(first, 1_000)
            turn = divide_half_away(second * DEG_PER_RAD_E9, 10**15)
        return self._limited(forward, turn)

    def _of_steps(self, value: int, step: int) -> int:
        return divide_half_away(value * step * self._steps, self._per)

    def steer(self, forward: int, turn: int) -> CommandedSpeeds:
        """Return the speeds of a pad's deflections: `forward` of `TRIGGER_FULL`, `turn` of `STICK_FULL` to the left."""
        return self._limited(
            divide_half_away(forward * self._pad_velocity_mm_s, TRIGGER_FULL),
            divide_half_away(turn * self._pad_rotation_mrad_s * DEG_PER_RAD_E9, STICK_FULL * 10**12),
        )

    def wheels_mm_s(self, speeds: CommandedSpeeds) -> tuple[int, int]:
        """Return the rim speeds (left, right) that commanded speeds mean, in whole mm/s."""
        rim = divide_half_away(speeds.turn_deg_s * self.track_mm * 10**9, 2 * DEG_PER_RAD_E9)
        return speeds.forward_mm_s - rim, speeds.forward_mm_s + rim

    def _limited(self, forward: int, turn: int) -> CommandedSpeeds:
        if abs(forward) > self.max_velocity_mm_s:
            turn = _scaled(turn, self.max_velocity_mm_s, abs(forward))
            forward = _scaled(forward, self.max_velocity_mm_s, abs(forward))
        if abs(turn) > self.max_rotation_deg_s:
            forward = _scaled(forward, self.max_rotation_deg_s, abs(turn))
            turn = _scaled(turn, self.max_rotation_deg_s, abs(turn))
        return CommandedSpeeds(forward, turn)


def _lower(robot: int, wanted: int | None) -> int:
    return robot if wanted is None else min(robot, wanted)


def _scaled(value: int, numerator: int, denominator: int) -> int:
    """Return value × numerator / denominator, towards zero."""
    magnitude = abs(value) * numerator // denominator
    return magnitude if value >= 0 else -magnitude
