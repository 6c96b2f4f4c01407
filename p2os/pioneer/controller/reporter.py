"""What the robot reports of itself: the standard packet, the extra packets, the CONFIGpac.

The reporter reads the body, the devices and the random streams, once a packet or once a
ping, and hands frames to the sender; when any of that happens is the controller's.
It decides nothing about the line but one thing: an extra packet that does not fit
before the next standard one is dropped.

Values that no part of this model knows are those of the one packet captured from a
P2-DX: bumpers that are not fitted read as floating inputs, the analog port is number
5, the heading set-point is the heading.

Source: Pioneer 2 and Pioneer 2/3 H8 manuals, tables of the SIP and of the extra packets.

Invariant: sensors are sampled before the packet that carries them, and a sonar reading
is in one packet only.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.controller.bumper_watch import pressed, stalls
from p2os.pioneer.controller.context import Context
from p2os.pioneer.controller.dead_reckoning import raw_angle
from p2os.pioneer.controller.flash import FlashParameters
from p2os.pioneer.controller.motion import UDEG_PER_DEG
from p2os.pioneer.controller.packet_requests import Extra
from p2os.pioneer.controller.sender import Sender
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.devices.laser import Laser
from p2os.pioneer.sonar.errors import measure_ranges
from p2os.pioneer.sonar.ring import eyes
from p2os.pioneer.sonar.schedule import raw_range
from p2os.protocol.config_packet import NUMBERS, ConfigPacket
from p2os.protocol.connection import Connection
from p2os.protocol.packets import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    EncoderPacket,
    IoPacket,
    PlaylistPacket,
    ServerPacket,
    SimDevice,
    SiminfoPacket,
    SimLaserPacket,
    SimstatPacket,
    packet_frame,
)
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import MOVING, STANDING, SonarReading, StandardSip
from p2os.robots.parameters import RobotParameters
from simbase.timing import NS_PER_MS, Nanos

RAD_PER_DEG = math.pi / 180

#: Seven floating inputs read as ones (the captured P2-DX packet: stall bytes FE FE).
BUMPERS_NOT_FITTED = 0x7F
#: Bits of the AROS and ARCOS flags (H8 manual, SIP table); 1 to 4 are the sonar arrays that are on.
FLAG_MOTORS, FLAG_STOP_BUTTON, FLAG_E_STALL = 1 << 0, 1 << 5, 1 << 6
FLAG_JOYSTICK, FLAG_CHARGING = 1 << 9, 1 << 10
#: The ARCOS tail where nothing is known: no fault, no sideways motion, no thermometer, no charge sensor.
NO_TEMPERATURE, CHARGE_UNKNOWN, CHARGE_BULK = -127, -1, 1
#: Count, checksum and a type byte: no frame is shorter.
SMALLEST_FRAME = 6
#: AUX ports' packets.
AUX_EXTRAS = (Extra.AUX1, Extra.AUX2, Extra.AUX3)


class Reporter:
    """Makes the packets of one robot."""

    def __init__(
        self, context: Context, body: RobotBody, sender: Sender, parameters: RobotParameters,
        settings: ControllerSettings, notify: Callable[[Nanos, str, str], None],
    ) -> None:  # fmt: skip
        self.context = context
        self.body = body
        self._sender = sender
        self.parameters = parameters
        self.settings = settings
        self._notify = notify
        self._eyes = eyes(parameters)

    def configuration(self) -> ConfigPacket:
        """Return the answer to CONFIG: the robot's own limits, and those in force."""
        settings, limits, kept = self.settings, self.context.motion.limits, self.context.kept
        working: dict[str, Any] = {name: _word(value, is_signed=NUMBERS[name][0] < 0) for name, value in kept.items()}
        config = settings.flash.config(self.parameters, self.context.profile)
        return replace(
            config, name=settings.name, serial=settings.serial, sipcycle=settings.sip_period_ns // NS_PER_MS,
            watchdog=settings.watchdog_ns // NS_PER_MS, rotvelmax=limits.max_rotation_deg_s,
            transvelmax=limits.max_velocity_mm_s, rotacc=limits.rot_accel_deg_s2, rotdecel=limits.rot_decel_deg_s2,
            transacc=limits.accel_mm_s2, transdecel=limits.decel_mm_s2,
            **working,
        )  # fmt: skip

    def fire(self, numbers: tuple[int, ...], heard: Sequence[float | None] | None = None) -> None:
        """Let sonar ping, and keep what they measure for the next packet.

        Args:
            numbers: Which.
            heard: What each takes another robot's ping for, metres, or None; None: it hears none.
        """
        parameters, settings = self.parameters, self.settings
        ranges = measure_ranges(
            self.body,
            numbers,
            parameters,
            settings.errors.sonar,
            self.context.faults.sonar,
            self.context.random_source,
            heard,
        )
        self.context.sonar.take_ping(
            [
                (number, raw_range(range_m, parameters, self.context.profile))
                for number, range_m in zip(numbers, ranges, strict=True)
            ]
        )

    def check_aux_requests(self) -> None:
        """Answer GETAUX where enough bytes have come."""
        for port, extra in zip(self.context.devices.aux, AUX_EXTRAS, strict=True):
            if port.has_answer:
                self.context.requests.set(extra, 1)

    def check_battery(self, now: Nanos) -> None:
        """Drain the battery, and act when it is low."""
        context, state = self.context, self.body.state
        battery, switches = context.devices.battery, context.devices.switches
        battery.look(
            now, motors_on=context.motors_enabled, rims_mps=abs(state.left_speed_mps) + abs(state.right_speed_mps),
            stalled=state.stalled_left + state.stalled_right,
        )  # fmt: skip
        if battery.decivolts < context.low_battery_decivolts and not switches.battery_reported:
            switches.battery_reported = True
            self._notify(now, "battery low", f"{battery.decivolts / 10:.1f} V")
        if battery.decivolts < self.settings.flash.number("shutdownvolts") and context.motors_enabled:
            context.motion.power(on=False)
            self._notify(now, "motors", "off: the battery is below SHUTDOWNVOLTS")

    def sample_gyro(self) -> None:
        """Take the gyro's reading that is due."""
        errors = self.settings.errors.heading
        noise = (
            self.context.random_source.of("gyro").gauss(0.0, errors.gyro_noise_counts)
            if errors.gyro_noise_counts
            else 0.0
        )
        self.context.devices.gyro.sample(self.body.state.turn_radps, errors.gyro_bias_counts + noise)

    def send_standard_packet(self, connection: Connection, now: Nanos) -> Nanos:
        """Send the packet of this moment and what goes with it; return when the next is due."""
        context, settings, sender = self.context, self.settings, self._sender
        self._sample_sensors(now)
        state = self.body.state
        segments = pressed(context, state, settings.flash)
        bumps = self._bumpers_reported(segments)
        packet = _standard_packet(context, state, self.parameters, stalls(context, state, now), bumps, now)
        due = now + settings.sip_period_ns
        frame = packet_frame(packet, context.profile)
        size = len(frame.to_bytes())
        before, after = context.requests.wanted(context.profile)
        for extra in before:
            self._send_extra(extra, segments, size, due, now)
        connection.send(frame, now)
        for data in connection.take_output():
            sender.put(data, now)
        for extra in after:
            self._send_extra(extra, segments, 0, due, now)
        sender.packet_sent()
        sender.line.end_cycle(now)
        context.sonar.start_cycle(now)
        return due

    def _sample_sensors(self, now: Nanos) -> None:
        """Do what the firmware does once a packet: battery, compass, odometry's own drift."""
        context, errors = self.context, self.settings.errors
        self.check_battery(now)
        compass = context.devices.compass
        if (compass.mode or Extra.COMPASS in context.requests.once) and compass.is_due(now):
            noise = errors.heading.compass_noise_deg
            error = errors.heading.compass_bias_deg + (
                self.context.random_source.of("compass").gauss(0.0, noise) if noise else 0.0
            )
            compass.read(self.body.state.heading_rad, self.body.state.pitch_rad, error, now)
        if errors.odometry.drift_deg:
            way_mm = abs(context.reckoning.travel_mm - context.drifted_at_mm)
            context.drifted_at_mm = context.reckoning.travel_mm
            deviation = errors.odometry.drift_deg * math.sqrt(way_mm / 1000)
            context.reckoning.drift(
                math.radians(self.context.random_source.of("drift").gauss(0.0, deviation)) if way_mm else 0.0
            )

    def _send_extra(self, extra: Extra, segments: tuple[int, int], reserved: int, due: Nanos, now: Nanos) -> None:
        """Send an extra packet if it leaves room for `reserved` bytes more before the next packet is due."""
        requests, line = self.context.requests, self._sender.line
        if not line.fits(reserved + SMALLEST_FRAME, now, due) and not requests.must_go(extra):
            requests.no_room(extra)
            return
        packets = self._packets_of(extra, segments, now)
        frames = [packet_frame(packet, self.context.profile).to_bytes() for packet in packets]
        if not line.fits(reserved + sum(map(len, frames)), now, due) and not requests.must_go(extra):
            requests.no_room(extra)
            return
        requests.sent(extra)
        for data in frames:
            self._sender.put(data, now)

    def _packets_of(self, extra: Extra, segments: tuple[int, int], now: Nanos) -> Sequence[ServerPacket]:
        """Return the packets of one request: one, but for a laser's sweep."""
        if extra is Extra.LASER:
            return self._sweep()
        if extra is Extra.IO:
            return (self._io_packet(segments, now),)
        if extra is Extra.SIMSTAT:
            return (_simstat_packet(self.body),)
        if extra is Extra.SIMINFO:
            return (_siminfo_packet(self.parameters, self.context.devices.laser),)
        return (MAKERS[extra](self.context, self.settings.flash, now),)

    def _io_packet(self, segments: tuple[int, int], now: Nanos) -> IoPacket:
        """Return the answer to IOREQUEST: pins, bumpers, and what the infra-red eyes see."""
        devices, front, rear = self.context.devices, *segments
        seen = sum(
            (self.body.scan(eye, eye.length_m)[0] < eye.length_m) << number for number, eye in enumerate(self._eyes)
        )
        return devices.pins.packet(
            digital_in=devices.digital_in(now), front=front, rear=rear, infrared=seen, now=now,
            decivolts=devices.battery.decivolts,
        )  # fmt: skip

    def _sweep(self) -> list[SimLaserPacket]:
        """Let the laser sweep once, all rays at the same moment."""
        laser, reckoning, equipment = self.context.devices.laser, self.context.reckoning, self.parameters.equipment
        ranges_m = self.body.scan(laser.fan(equipment.laser_x_mm, equipment.laser_y_mm), laser.range_m)
        return laser.packets(ranges_m, (reckoning.x_mm, reckoning.y_mm, math.degrees(reckoning.heading_rad)))

    def _bumpers_reported(self, segments: tuple[int, int]) -> tuple[int, int]:
        """Return front and rear as the standard packet has them: without bumpers a P2OS robot reads ones."""
        flash = self.settings.flash
        floating = 0 if self.context.profile.has_flags else BUMPERS_NOT_FITTED
        fitted = flash.number("frontbumps"), flash.number("rearbumps")
        return (
            segments[0] if fitted[0] or segments[0] else floating,
            segments[1] if fitted[1] or segments[1] else floating,
        )


# The standard packet --------------------------------------------------------------------


def _standard_packet(
    context: Context,
    wheels: BodyState,
    parameters: RobotParameters,
    stalls: tuple[bool, bool],
    bumps: tuple[int, int],
    now: Nanos,
) -> StandardSip:
    """Return the packet that describes this moment, and take the sonar readings that it carries.

    Args:
        context: The robot's parts.
        wheels: What its wheels do.
        parameters: Its conversions.
        stalls: Left and right wheel.
        bumps: Front and rear segments as this family reports them.
        now: The time, ns.
    """
    raw_x, raw_y = context.reckoning.raw_position(parameters.distance_nm_per_count)
    left, right = (_raw_velocity(speed, parameters) for speed in (wheels.left_speed_mps, wheels.right_speed_mps))
    devices, profile = context.devices, context.profile
    return StandardSip(
        kind=MOVING if left or right else STANDING,
        raw_x=raw_x,
        raw_y=raw_y,
        raw_heading=raw_angle(context.reckoning.heading_rad, parameters.angle_counts_per_turn),
        raw_left_velocity=left,
        raw_right_velocity=right,
        raw_battery=devices.battery.decivolts,
        stall_left=stalls[0],
        stall_right=stalls[1],
        rear_bumpers=bumps[1],
        front_bumpers=bumps[0],
        raw_control=_raw_heading_setpoint(context, parameters),
        raw_flags=_flags(context) if profile.has_flags else devices.pins.servos[0],
        raw_compass=devices.compass.raw_compass,
        sonar=tuple(SonarReading(number, counts) for number, counts in context.sonar.take_readings()),
        analog_port=devices.pins.selected,
        gripper_state=int(devices.gripper.state(now)),
        raw_analog=devices.pins.raw_analog,
        digital_in=devices.digital_in(now),
        digital_out=devices.pins.output(now),
        tail=_arcos_tail(context, wheels, parameters) if profile is Profile.ARCOS else (),
    )


def _flags(context: Context) -> int:
    devices = context.devices
    pressed = devices.switches.stop_button
    return (
        context.motors_enabled * FLAG_MOTORS
        | sum(1 << array for array in context.sonar.arrays)
        | pressed * FLAG_STOP_BUTTON
        | (pressed and devices.switches.e_stall) * FLAG_E_STALL
        | bool(devices.joystick.button1) * FLAG_JOYSTICK
        | devices.battery.is_charging * FLAG_CHARGING
    )


def _raw_velocity(speed_mps: float, parameters: RobotParameters) -> int:
    return round(speed_mps * 1_000_000 / parameters.velocity_um_s_per_count)


def _raw_heading_setpoint(context: Context, parameters: RobotParameters) -> int:
    """Return where the robot turns to, or its heading when it turns by speed."""
    goal_udeg, heading_rad = context.motion.heading_goal_udeg, context.reckoning.heading_rad
    if goal_udeg is not None:
        heading_rad = goal_udeg / UDEG_PER_DEG * RAD_PER_DEG - context.reckoning.zero_rad
    return raw_angle(heading_rad, parameters.angle_counts_per_turn)


def _arcos_tail(context: Context, wheels: BodyState, parameters: RobotParameters) -> tuple[int, ...]:
    """Return the tail up to the state of charge, as far as ARCOS itself sends it."""
    turn_rad_s = (wheels.right_speed_mps - wheels.left_speed_mps) * 1000 / parameters.track_mm
    battery = context.devices.battery
    charge_state = CHARGE_BULK if battery.is_charging else CHARGE_UNKNOWN
    return (
        battery.decivolts, charge_state, round(turn_rad_s / RAD_PER_DEG * 10), 0, 0, NO_TEMPERATURE, 0,
    )  # fmt: skip


# The extra packets --------------------------------------------------------------------

#: What one packet is made from: the parts, the FLASH, the time.
Maker = Callable[[Context, FlashParameters, Nanos], ServerPacket]


def _encoder_packet(context: Context, flash: FlashParameters) -> EncoderPacket:
    """Return both encoders' counts since the start, in TICKSMM of the FLASH."""
    ticks = context.kept.get("ticksmm", flash.number("ticksmm"))
    return EncoderPacket(
        left_counts=_signed32(round(context.reckoning.left_mm * ticks)),
        right_counts=_signed32(round(context.reckoning.right_mm * ticks)),
    )


def _battery_packet(context: Context) -> BatteryPacket:
    """Return one battery's row: no flags, its charge twice."""
    charge = context.devices.battery.state_of_charge
    return BatteryPacket(batteries=((0, 0, 0, charge, charge),))


def _simstat_packet(body: RobotBody) -> SimstatPacket:
    """Return where the robot really is; the simulator's name is left out, as AMRISim leaves it out."""
    state, interval_ms = body.state, max(body.dt_ns // NS_PER_MS, 1)
    return SimstatPacket(
        wanted_interval_ms=interval_ms, real_interval_ms=interval_ms, last_interval_ms=interval_ms,
        x_mm=round(state.x_m * 1000), y_mm=round(state.y_m * 1000), z_mm=round(state.z_m * 1000),
        heading_deg=round(math.degrees(math.remainder(state.heading_rad, math.tau))),
    )  # fmt: skip


def _siminfo_packet(parameters: RobotParameters, laser: Laser) -> SiminfoPacket:
    """Return which simulator this is, and what the robot has that measures distances."""
    found = []
    if parameters.sonar_fitted:
        found.append(SimDevice(raw_name=b"sonar", raw_type=b"sonar", number=0, status=1))
    if laser.is_fitted:
        found.append(SimDevice(raw_name=b"laser", raw_type=b"laser", number=0, status=int(laser.mode > 0)))
    return SiminfoPacket(raw_name=b"p2os", devices=tuple(found))


def _word(value: int, *, is_signed: bool) -> int:
    """Return a number as a word of the FLASH holds it."""
    word = value & 0xFFFF
    return word - 0x10000 if is_signed and word >= 0x8000 else word


def _signed32(value: int) -> int:
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)


MAKERS: Mapping[Extra, Maker] = {
    Extra.GYRO: lambda context, _flash, _now: context.devices.gyro.take_packet(),
    Extra.JOYSTICK: lambda context, _flash, _now: context.devices.joystick.packet(),
    Extra.ENCODER: lambda context, flash, _now: _encoder_packet(context, flash),
    Extra.GRIPPER: lambda context, _flash, now: context.devices.gripper.packet(now),
    Extra.COMPASS: lambda context, _flash, _now: context.devices.compass.packet(),
    Extra.AUX1: lambda context, _flash, _now: context.devices.aux[0].take_answer(),
    Extra.AUX2: lambda context, _flash, _now: context.devices.aux[1].take_answer(),
    Extra.AUX3: lambda context, _flash, _now: context.devices.aux[2].take_answer(),
    Extra.PLAYLIST: lambda _context, _flash, _now: PlaylistPacket(),
    Extra.ARM: lambda _context, _flash, _now: ArmPacket(),
    Extra.ARM_INFO: lambda _context, _flash, _now: ArmInfoPacket(),
    Extra.BATTERY: lambda context, _flash, _now: _battery_packet(context),
}
