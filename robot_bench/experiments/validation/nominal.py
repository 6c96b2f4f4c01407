"""What a bench should do by its settings: speeds, ramps and delays, each with the formula that it comes from.

Everything here is worked out from the scenario as it stands, before anything is run and without looking at a part of
the bench; what is set otherwise for a trial (`--set`) does not move what is expected of it.
"""

import math
from dataclasses import dataclass

from p2os.protocol.bauds import DEFAULT_BAUD
from p2os.protocol.line_time import LineTime
from p2os.protocol.times import CYCLE_NS
from robot_bench.events.kinds import Pose
from robot_bench.experiments.validation.figures import FigureTolerance
from robot_bench.experiments.validation.signals import ENCODER_STEPS, packets
from robot_bench.recording.client_view import OdometryPose
from robot_bench.recording.recorder import SAMPLE_NS
from robot_bench.recording.run_record import RunRecord
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_S, Nanos

#: The line at the speed that robots begin with.
LINE = LineTime(DEFAULT_BAUD)
#: A pair of VEL and RVEL: two frames of nine bytes. Source: PROTOCOL.md.
PAIR_BYTES = 18
#: A standard packet with two sonar readings, as a Pioneer 2 sends it; each reading more is three bytes.
SIP_BYTES = 36
#: The body's step.
BODY_STEP_S = 1e-3
#: The recording's time between two poses, seconds.
POSE_S = SAMPLE_NS / NS_PER_S
#: A tick of the example programs, seconds.
TICK_S = 0.01
#: chosen: what a program may take from its tick to its pins, and to the end of a line of text, seconds.
PROGRAM_S = 1e-3
#: chosen: by how much that differs from tick to tick: 3,600 cycles at 72 MHz.
JITTER_S = 50e-6
#: chosen: by how much one packet comes later than another, seconds.
PACKET_JITTER_S = 0.05
#: chosen: what the adapter's integers and a reader's floats may differ by over minutes, in steps of an encoder.
ARITHMETIC_STEPS = 0.02
#: The trace's resolution of a rim's speed, mm/s; the bodies hold what their motors want.
BODY_MM_S = 1e-3
#: Of a robot at a port only its packets are known: whole mm/s of a wheel, and a time that is that of a packet.
PORT_MM_S = 1.0


@dataclass(frozen=True, slots=True)
class Delay:
    """A time in seconds and how it comes about."""

    seconds: float
    formula: str

    def __add__(self, other: "Delay") -> "Delay":
        return Delay(self.seconds + other.seconds, f"{self.formula} + {other.formula}")

    def bound(self, name: str) -> FigureTolerance:
        """Return it as a bound in seconds."""
        return FigureTolerance(name=name, value=self.seconds, formula=f"{self.formula} = {self.seconds * 1000:.4g} ms")


class Nominal:
    """What is expected of a scenario's bench.

    Args:
        scenario: As it stands, with its mode.
        at_port: Whether its robot stands at a port.
    """

    def __init__(self, scenario: Scenario, *, at_port: bool = False) -> None:
        self.at_port = at_port
        self.is_direct = scenario.mode == "direct"
        robot, adapter = scenario.parameters, scenario.adapter
        settings = scenario.direct if self.is_direct else adapter
        self.step_mm_s = settings.step_um_per_s / 1000
        self.track_mm = robot.track_mm
        self.encoder_step_mm = math.pi * robot.body.wheel_diameter_m * 1000 / ENCODER_STEPS
        ramp = scenario.direct.ramp_um_per_s2
        #: Change of a rim's speed a second where both wheels do the same, and where they turn the robot; 0: jumps.
        self.ramp_mm_s2 = (ramp or 0) / 1000 if self.is_direct else float(robot.motion.accel_mm_s2)
        turning = math.radians(robot.motion.rot_accel_deg_s2) * robot.track_mm / 2
        self.turn_ramp_mm_s2 = self.ramp_mm_s2 if self.is_direct else turning
        motion = robot.max_velocity_mm_s, robot.max_rotation_deg_s
        wanted = adapter.max_velocity_mm_s, adapter.max_rotation_deg_s
        self._caps = [
            math.inf if self.is_direct else float(ceiling if cap is None else min(cap, ceiling))
            for cap, ceiling in zip(wanted, motion, strict=True)
        ]
        self._distance_mm = robot.distance_nm_per_count / 1e6
        self._heading_mm = math.pi * robot.track_mm / robot.angle_counts_per_turn
        #: Without a packet for so long the adapter gives the robot up, seconds.
        self.liveness_s = adapter.liveness_ns / NS_PER_S
        self._robot, self._profile = robot, scenario.controller.family_of(robot)
        self._direct, self._adapter = scenario.direct, adapter
        #: From packet to packet, seconds: as the robot's FLASH has it.
        self.cycle_s = CYCLE_NS / NS_PER_S if at_port else scenario.controller.sip_period_ns / NS_PER_S
        #: From pose to pose of a recording, seconds; at a port a packet tells one.
        self.pose_s = self.cycle_s if at_port else POSE_S
        readings = scenario.controller.sonar_per_sip.pings_per_cycle or robot.sonar_fitted
        self._rounds = math.ceil(robot.sonar_fitted / readings)

    @property
    def suffix(self) -> str:
        """What the name of a delay ends with, whose size is another in each mode."""
        return ", direct" if self.is_direct else ", at a port" if self.at_port else ""

    def speeds(self, pair: tuple[int, int]) -> tuple[float, float]:
        """Return mm/s forward and degrees/s to the left for a pair of motor values, both shrunk to the caps."""
        forward, turn = self._asked(pair)
        share = self._share(pair)
        return forward * share, turn * share

    def rims_mm_s(self, pair: tuple[int, int]) -> tuple[float, float]:
        """Return the speeds of both rims, left first."""
        forward, turn = self.speeds(pair)
        rim = math.radians(turn) * self.track_mm / 2
        return forward - rim, forward + rim

    def _asked(self, pair: tuple[int, int]) -> tuple[float, float]:
        left, right = pair
        return (left + right) / 2 * self.step_mm_s, math.degrees((right - left) * self.step_mm_s / self.track_mm)

    def _share(self, pair: tuple[int, int]) -> float:
        """Return by which factor the caps of the adapter shrink both speeds: 1 within them, and in mode direct."""
        asked = zip(self._asked(pair), self._caps, strict=True)
        return min([1.0, *(cap / abs(value) for value, cap in asked if value)])

    def rounding(self, pair: tuple[int, int]) -> tuple[tuple[float, str], tuple[float, str]]:
        """Return by how much VEL and RVEL may be off, each with its formula; both are whole numbers.

        Where a cap is reached, a whole number is shrunk by a ratio of whole numbers, and rounded towards zero.
        """
        if self._share(pair) == 1.0:
            return (0.5, "VEL is whole mm/s: half of it"), (0.5, "RVEL is whole deg/s: half of it")
        found = []
        for value, other in zip(self.speeds(pair), reversed(self._asked(pair)), strict=True):
            ratio = 0.5 * abs(value / other) if other else 0.0
            found.append(
                (1.5 + ratio, f"1 (towards zero) + 0.5 + 0.5 / {abs(other):.4g} x {abs(value):.4g} (the ratio)")
            )
        return found[0], found[1]

    def speed_bound(self, pair: tuple[int, int]) -> FigureTolerance:
        """How far a steady rim speed may be off, mm/s."""
        seen, told = (PORT_MM_S, "of its packets") if self.at_port else (BODY_MM_S, "of the trace")
        if self.is_direct:
            return FigureTolerance(name="rim speed, direct", value=seen, formula=f"resolution {told} {seen:g} mm/s")
        (vel, _), (rvel, _) = self.rounding(pair)
        rim = math.radians(rvel) * self.track_mm / 2
        return FigureTolerance(
            name="rim speed" + self._kind(pair), value=vel + rim + seen,
            formula=f"{vel:.3g} mm/s (VEL is whole mm/s) + {rvel:.3g} deg/s x {self.track_mm / 2:g} mm (RVEL is whole"
            f" deg/s) + resolution {told} {seen:g} mm/s = {vel + rim + seen:.3g} mm/s",
        )  # fmt: skip

    def rounding_bounds(self, pair: tuple[int, int]) -> tuple[FigureTolerance, FigureTolerance]:
        """How far VEL and RVEL may be off."""
        (vel, vel_formula), (rvel, rvel_formula) = self.rounding(pair)
        return (
            FigureTolerance(name="rounding of VEL" + self._kind(pair), value=vel, formula=vel_formula),
            FigureTolerance(name="rounding of RVEL" + self._kind(pair), value=rvel, formula=rvel_formula),
        )

    def _kind(self, pair: tuple[int, int]) -> str:
        return ", at a port" if self.at_port else ", at a cap" if self._share(pair) < 1.0 else ""

    def way_bound(self, pair: tuple[int, int], mm_s: float, span_s: float) -> FigureTolerance:
        """How far a steady rim speed may be off by the way of so many seconds, mm/s."""
        speed = self.speed_bound(pair)
        if not self.at_port:
            return speed
        counts = 2 * (math.sqrt(2) * self._distance_mm + self._heading_mm)
        more = (counts + abs(mm_s) * PACKET_JITTER_S) / span_s
        return FigureTolerance(
            name="way in a time, at a port", value=speed.value + more,
            formula=f"{speed.formula.partition(' = ')[0]} + (a count of x, of y and of heading at both ends"
            f" {counts:.3g} mm + {abs(mm_s):g} mm/s x {PACKET_JITTER_S * 1000:g} ms that a packet may come late)"
            f" / {span_s:.2f} s = {speed.value + more:.3g} mm/s",
        )  # fmt: skip

    def to_free_line(self, characters: int = PAIR_BYTES) -> Delay:
        """As `to_command`, where no pair went out just before; of a pair the first of two frames is VEL."""
        votes, line = self._adapter.sample_count // 2 + 1, LINE.time_of(characters) / NS_PER_S
        period = self._adapter.sample_period_ns / NS_PER_S
        return Delay(
            votes * period + line,
            f"{votes} samples of {period * 1000:g} ms + {characters} characters {line * 1000:.4g} ms",
        )

    @property
    def spacing(self) -> Delay:
        """From the beginning of a pair of commands to that of the next, at least."""
        seconds = self._adapter.pair_spacing_ns / NS_PER_S
        return Delay(seconds, f"spacing of pairs {seconds * 1000:g} ms")

    @property
    def to_command(self) -> Delay:
        """From a change of the motor pins to the last byte of the pair of commands at the robot, at most."""
        return self.to_free_line() + self.spacing

    @property
    def to_motion(self) -> Delay:
        """From a change of the motor pins to the beginning of the wheels' ramp, at most."""
        body = Delay(BODY_STEP_S, "a step of the body 1 ms")
        if self.at_port:
            body += Delay(self.cycle_s + self.packet_s, f"a packet's age and its {SIP_BYTES} characters")
        return body if self.is_direct else self.to_command + body

    @property
    def to_distance_pin(self) -> Delay:
        """From a thing that appears or goes to the distance pin, at most."""
        if self.is_direct:
            seconds = self._direct.sensor_period_ns / NS_PER_S
            return Delay(seconds, f"a period of the sensors {seconds * 1000:g} ms")
        cycle = self.cycle_s
        return Delay(
            (self._rounds + 1) * cycle + self.packet_s,
            f"{self._rounds} packets for a round of all sonar x {cycle * 1000:g} ms"
            f" + a reading waits for its packet {cycle * 1000:g} ms"
            f" + {SIP_BYTES} characters {self.packet_s * 1000:.4g} ms",
        )  # fmt: skip

    @property
    def packet_s(self) -> float:
        """Time of a standard packet on the line, seconds."""
        return LINE.time_of(SIP_BYTES) / NS_PER_S

    @property
    def encoder_period_s(self) -> float:
        """From one sample of a wheel's angle to the next."""
        return self._direct.encoder_period_ns / NS_PER_S if self.is_direct else self.cycle_s

    def encoder_lag(self, rim_mm_s: float) -> Delay:
        """How old a code on the pins may be; of several codes that a packet tells one follows the other."""
        if self.is_direct:
            return Delay(self.encoder_period_s, "period of the encoders")
        seconds, formula = self.cycle_s + self.packet_s + TICK_S, "packet cycle, its characters and a pass"
        walked = math.floor(abs(rim_mm_s) * self.cycle_s / self.encoder_step_mm)
        dwell_s = self._adapter.encoder_dwell_ns / NS_PER_S
        more = f", {walked} codes more x {dwell_s * 1000:g} ms" if walked else ""
        return Delay(seconds + walked * dwell_s, formula + more)

    def packet_poses(self, record: RunRecord) -> list[Pose]:
        """Return the poses that the robot's packets tell, each when its packet had arrived."""
        odometry = OdometryPose(self._robot)
        return [odometry.take(sip, t) for t, sip in packets(record, self._profile)]

    def walk_ns(self, steps: float) -> Nanos:
        """Return how long the pins walk through so many steps of an encoder after a packet, at most."""
        return (math.ceil(steps) + 2) * self._adapter.encoder_dwell_ns

    @property
    def encoder_packet_bound(self) -> FigureTolerance:
        """How far a code may be from what the robot's packets tell of its wheel, steps, where it has been walked to."""
        return FigureTolerance(
            name="encoder after a packet", value=0.5 + ARITHMETIC_STEPS,
            formula=f"half a step + {ARITHMETIC_STEPS:g} steps of integer arithmetic",
        )  # fmt: skip

    def encoder_bound(self, rim_mm_s: float) -> FigureTolerance:
        """How far the code on the pins may be from the wheel's angle, steps; the middle of a code is its angle."""
        lag = self.encoder_lag(rim_mm_s)
        odometry = 0.0 if self.is_direct else math.sqrt(2) * self._distance_mm + self._heading_mm
        counts = f" + a count of x, of y and of heading {odometry:.3g} mm" if odometry else ""
        moved = abs(rim_mm_s) * lag.seconds + odometry
        value = 0.5 + moved / self.encoder_step_mm
        return FigureTolerance(
            name="encoder while it turns", value=value,
            formula=f"half a step + ({abs(rim_mm_s):.4g} mm/s x {lag.seconds * 1000:.4g} ms ({lag.formula}){counts})"
            f" / {self.encoder_step_mm:.4g} mm = {value:.3g} steps",
        )  # fmt: skip
