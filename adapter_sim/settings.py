"""Everything about the adapter that can be set, with its unit in its name.

Invariant: settings that exist are valid; the adapter checks nothing twice.
"""

from dataclasses import dataclass, fields
from enum import StrEnum

from adapter_sim.codec import BitOrder
from adapter_sim.duty import DUTY_TIMEOUT_NS
from p2os.gamepad import PAD_DEAD, PAD_LOSS_NS, PAD_MM_S, PAD_MRAD_S, STICK_FULL, TRIGGER_FULL
from p2os.protocol.bauds import DEFAULT_BAUD
from p2os.protocol.times import LIVENESS_NS, PULSE_NS
from p2os.robots.motor_step import STEP_UM_PER_S
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos


class MotorMeaning(StrEnum):
    """What the two motor values stand for."""

    #: motor1 is the left wheel's speed, motor2 the right one's.
    WHEELS = "wheels"
    #: motor1 is the forward speed, motor2 the turn to the left, as one printed listing has it.
    LINEAR_ANGULAR = "linear_angular"


class MotorCommand(StrEnum):
    """How the motor wires carry a wheel's value."""

    #: Two's complement of a few bits, a wire each.
    BITS = "bits"
    #: A magnitude by the duty of the first wire, and a sign on the last: adapter_sim/duty.py.
    DUTY = "duty"


class EncoderAtOpen(StrEnum):
    """Where the encoders stand when a session with the robot opens."""

    #: At phase 0, in every session; the pins walk there one code at a time.
    ZERO = "zero"
    #: Where the wheels stood when the last session ended: absolute, whatever was reset or reconnected since.
    CONTINUE = "continue"


#: More line speeds than this are not searched.
MAX_BAUDS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class AdapterSettings:
    """The adapter's settings; every one has a default that works.

    Raises:
        UsageError: A value is out of its range or fits no other.
    """

    #: Nearer than this is an obstacle; None takes half of the robot file's sonar range.
    threshold_um: int | None = None
    motor_command: MotorCommand = MotorCommand.BITS
    bit_order: BitOrder = BitOrder.COMM3_MSB
    motor_meaning: MotorMeaning = MotorMeaning.WHEELS
    step_um_per_s: int = STEP_UM_PER_S
    #: Turn rate of one step where motor2 is angular (the thesis: 1.7 rad/s at four steps).
    angular_step_urad_per_s: int = 425_000
    #: Caps of what is sent; None leaves the robot file's own limits, which hold in any case.
    max_velocity_mm_s: int | None = None
    max_rotation_deg_s: int | None = None

    sample_period_ns: Nanos = 2 * NS_PER_MS
    #: A motor wire without an edge for this long has a level, not a duty.
    duty_timeout_ns: Nanos = DUTY_TIMEOUT_NS
    #: Samples in the majority window, odd.
    sample_count: int = 5
    #: p2dx_con must be seen high for MORE than this.
    connect_after_ns: Nanos = 10 * NS_PER_MS
    #: p2dx_con must be seen low for this long.
    disconnect_after_ns: Nanos = 10 * NS_PER_MS
    #: From rst low (or power) to the first sample.
    boot_ns: Nanos = 300 * NS_PER_MS

    #: Two VEL+RVEL pairs are at least this far apart; a pair takes 18.75 ms at 9600 baud.
    pair_spacing_ns: Nanos = 25 * NS_PER_MS
    #: An unchanged pair is sent again after this long.
    refresh_ns: Nanos = 200 * NS_PER_MS
    #: PULSE after this long without any frame, while no pairs are sent.
    pulse_ns: Nanos = PULSE_NS

    #: No valid SIP for this long is a loss.
    liveness_ns: Nanos = LIVENESS_NS
    #: After OPEN the first SIP may take this long.
    first_sip_ns: Nanos = 1 * NS_PER_S
    #: After a connection that failed, the next try begins this much later.
    retry_ns: Nanos = 1 * NS_PER_S
    #: SIP speeds that neither approach the command nor come with a stall flag for this long.
    plausibility_ns: Nanos = 1 * NS_PER_S
    #: A wheel within this of its command follows it. # chosen: over half a step
    plausibility_tolerance_mm_s: int = 40
    #: Coming nearer by this much counts as approaching. # chosen: above the jitter of a wheel at rest
    plausibility_progress_mm_s: int = 5
    #: A distance older than this is unknown. # chosen: two rounds of eight sonar at two a SIP, and two lost SIPs
    distance_stale_ns: Nanos = 1 * NS_PER_S
    #: How long the odometry may take to read zero after SETO, before it is taken as it is.
    settle_ns: Nanos = 500 * NS_PER_MS
    encoder_at_open: EncoderAtOpen = EncoderAtOpen.CONTINUE
    #: A code stays on the pins this long at least. # chosen: two polls of a 100 Hz program; 50 codes/s are 3.2 m/s
    encoder_dwell_ns: Nanos = 20 * NS_PER_MS
    #: Whether a robot of unknown state is stopped too: at boot and before each SYNC0. Only for a peer that takes
    #: its first packet for a SYNC whatever it is (AMRISim's default build) must this be off.
    stop_unknown_robot: bool = True
    #: After a loss the stop sequence goes out once, then this many times more.
    stop_repeats: int = 3
    stop_repeat_ns: Nanos = 200 * NS_PER_MS

    #: Line speeds tried in turn while nobody answers, 1 to 8 of them.
    bauds: tuple[int, ...] = (DEFAULT_BAUD,)

    #: Of a game pad: speeds at full deflection, what counts as at rest, and the silence after which it is lost.
    pad_velocity_mm_s: int = PAD_MM_S
    pad_rotation_mrad_s: int = PAD_MRAD_S
    pad_trigger_dead: int = PAD_DEAD
    pad_stick_dead: int = PAD_DEAD
    pad_loss_ns: Nanos = PAD_LOSS_NS

    def __post_init__(self) -> None:
        self._check_bauds()
        self._coerce("motor_command", MotorCommand)
        self._coerce("bit_order", BitOrder)
        self._coerce("motor_meaning", MotorMeaning)
        self._coerce("encoder_at_open", EncoderAtOpen)
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, StrEnum) or value is None or field.name in {"stop_unknown_robot", "bauds"}:
                continue
            if not isinstance(value, int) or isinstance(value, bool):
                raise UsageError(f"adapter setting {field.name} must be an integer, got {value!r}")
            least = 0 if field.name in MAY_BE_ZERO else 1
            if value < least:
                raise UsageError(f"adapter setting {field.name} must be {least} or more, got {value}")
        if not isinstance(self.stop_unknown_robot, bool):
            raise UsageError(
                f"adapter setting stop_unknown_robot must be true or false, got {self.stop_unknown_robot!r}"
            )
        if self.sample_count % 2 == 0:
            raise UsageError(f"adapter setting sample_count must be odd for a majority, got {self.sample_count}")
        if self.pad_trigger_dead >= TRIGGER_FULL or self.pad_stick_dead >= STICK_FULL:
            raise UsageError(
                f"adapter settings pad_trigger_dead = {self.pad_trigger_dead}, pad_stick_dead = {self.pad_stick_dead} "
                "leave nothing of the pad",
                hint=f"below {TRIGGER_FULL} and below {STICK_FULL}",
            )
        if self.refresh_ns < self.pair_spacing_ns:
            raise UsageError(
                f"adapter setting refresh_ns ({self.refresh_ns}) is below pair_spacing_ns ({self.pair_spacing_ns})",
                hint="two pairs cannot be nearer to each other than pair_spacing_ns",
            )

    def _check_bauds(self) -> None:
        bauds = self.bauds
        if (
            not isinstance(bauds, tuple | list)
            or not 1 <= len(bauds) <= MAX_BAUDS
            or not all(isinstance(baud, int) and not isinstance(baud, bool) and baud > 0 for baud in bauds)
        ):
            raise UsageError(
                f"adapter setting bauds is {bauds!r}", hint=f"1 to {MAX_BAUDS} line speeds such as [9600, 38400]"
            )
        object.__setattr__(self, "bauds", tuple(bauds))

    def _coerce(self, name: str, kind: type[StrEnum]) -> None:
        value = getattr(self, name)
        try:
            object.__setattr__(self, name, kind(value))
        except ValueError:
            choices = ", ".join(member.value for member in kind)
            raise UsageError(f"adapter setting {name} is {value!r}", hint=f"one of {choices}") from None


#: Settings for which 0 is a meaning: no debounce, no boot, no dwell, no repeats, no motion at all.
MAY_BE_ZERO = frozenset(
    {
        "connect_after_ns", "disconnect_after_ns", "boot_ns", "encoder_dwell_ns", "stop_repeats",
        "max_velocity_mm_s", "max_rotation_deg_s", "step_um_per_s", "angular_step_urad_per_s",
        "threshold_um", "plausibility_tolerance_mm_s", "pad_velocity_mm_s", "pad_rotation_mrad_s", "pad_trigger_dead",
        "pad_stick_dead",
    }
)  # fmt: skip
