"""What the robot senses and says, once a packet or once a ping: the controller's mouth.

It looks at the body, the devices and the random streams, and hands frames to the
sender; when any of that happens is the controller's.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from p2os.config_packet import ConfigPacket
from p2os.connection import Connection
from p2os.packets import packet_frame
from p2os.parameters import RobotParameters
from p2os.pioneer.extra_packets import MAKERS
from p2os.pioneer.guard import pressed, stalls
from p2os.pioneer.ports import Body
from p2os.pioneer.reports import BUMPERS_NOT_FITTED, standard_packet
from p2os.pioneer.requests import Extra
from p2os.pioneer.sender import Sender
from p2os.pioneer.settings import ControllerSettings
from p2os.pioneer.sonar_errors import hear
from p2os.pioneer.sonar_schedule import raw_range
from p2os.pioneer.works import Works
from p2os.timing import NS_PER_MS, Nanos

#: Count, checksum and a type byte: no frame is shorter.
SMALLEST_FRAME = 6
#: AUX ports' packets.
AUX_EXTRAS = (Extra.AUX1, Extra.AUX2, Extra.AUX3)


class Reporter:
    """Makes the packets of one robot."""

    def __init__(
        self, works: Works, body: Body, sender: Sender, parameters: RobotParameters, settings: ControllerSettings,
        tell: Callable[[Nanos, str, str], None],
    ) -> None:  # fmt: skip
        self.works = works
        self.body = body
        self._sender = sender
        self.parameters = parameters
        self.settings = settings
        self._tell = tell

    def configuration(self) -> ConfigPacket:
        """Return the answer to CONFIG: the robot's own limits, and those in force."""
        settings, limits, kept = self.settings, self.works.motion.limits, self.works.kept
        told: dict[str, Any] = {name: value & 0xFFFF for name, value in kept.items() if name != "driftfactor"}
        config = settings.flash.config(self.parameters, settings.profile)
        return replace(
            config, name=settings.name, serial=settings.serial, sipcycle=settings.sip_period_ns // NS_PER_MS,
            watchdog=settings.watchdog_ns // NS_PER_MS, rotvelmax=limits.max_rotation_deg_s,
            transvelmax=limits.max_velocity_mm_s, rotacc=limits.rot_accel_deg_s2, rotdecel=limits.rot_decel_deg_s2,
            transacc=limits.accel_mm_s2, transdecel=limits.decel_mm_s2,
            **told,
        )  # fmt: skip

    def fire(self, numbers: tuple[int, ...]) -> None:
        """Let sonar ping, and keep what they hear for the next packet."""
        parameters, settings = self.parameters, self.settings
        ranges = hear(self.body, numbers, parameters, settings.errors.sonar, self.works.faults.sonar, self.works.chance)
        self.works.sonar.take_ping(
            [
                (number, raw_range(range_m, parameters, settings.profile))
                for number, range_m in zip(numbers, ranges, strict=True)
            ]
        )

    def look_at_aux(self) -> None:
        """Answer GETAUX where enough bytes have come."""
        for port, extra in zip(self.works.rack.aux, AUX_EXTRAS, strict=True):
            if port.has_answer:
                self.works.requests.set(extra, 1)

    def look_at_battery(self, now: Nanos) -> None:
        """Drain the battery, and act when it is low."""
        works, state = self.works, self.body.state
        battery, switches = works.rack.battery, works.rack.switches
        battery.look(
            now, motors_on=works.motors_enabled, rims_mps=abs(state.left_speed_mps) + abs(state.right_speed_mps),
            stalled=state.stalled_left + state.stalled_right,
        )  # fmt: skip
        if battery.decivolts < works.low_battery_decivolts and not switches.battery_told:
            switches.battery_told = True
            self._tell(now, "battery low", f"{battery.decivolts / 10:.1f} V")
        if battery.decivolts < self.settings.flash.number("shutdownvolts") and works.motors_enabled:
            works.motion.power(on=False)
            self._tell(now, "motors", "off: the battery is below SHUTDOWNVOLTS")

    def sample_gyro(self) -> None:
        """Take the gyro's reading that is due."""
        errors = self.settings.errors.heading
        noise = self.works.chance.of("gyro").gauss(0.0, errors.gyro_noise_counts) if errors.gyro_noise_counts else 0.0
        self.works.rack.gyro.sample(self.body.state.turn_radps, errors.gyro_bias_counts + noise)

    def _look_at_sensors(self, now: Nanos) -> None:
        """Do what the firmware does once a packet: battery, compass, odometry's own drift."""
        works, errors = self.works, self.settings.errors
        self.look_at_battery(now)
        compass = works.rack.compass
        if (compass.mode or Extra.COMPASS in works.requests.once) and compass.is_due(now):
            noise = errors.heading.compass_noise_deg
            error = errors.heading.compass_bias_deg + (
                self.works.chance.of("compass").gauss(0.0, noise) if noise else 0.0
            )
            compass.read(self.body.state.heading_rad, self.body.state.pitch_rad, error, now)
        if errors.odometry.drift_deg:
            way_mm = abs(works.reckoning.travel_mm - self.works.drifted_at_mm)
            self.works.drifted_at_mm = works.reckoning.travel_mm
            deviation = errors.odometry.drift_deg * math.sqrt(way_mm / 1000)
            works.reckoning.drift(math.radians(self.works.chance.of("drift").gauss(0.0, deviation)) if way_mm else 0.0)

    def send_standard_packet(self, connection: Connection, now: Nanos) -> Nanos:
        """Send the packet of this moment and what goes with it; return when the next is due."""
        works, settings, sender = self.works, self.settings, self._sender
        self._look_at_sensors(now)
        state = self.body.state
        segments = pressed(works, state, settings.flash)
        told = self._bumpers_told(segments)
        packet = standard_packet(works, state, self.parameters, stalls(works, state, now), told, now)
        due = now + settings.sip_period_ns
        frame = packet_frame(packet, settings.profile)
        size = len(frame.to_bytes())
        before, after = works.requests.wanted(settings.profile)
        for extra in before:
            self._send_extra(extra, segments, size, due, now)
        connection.send(frame, now)
        for data in connection.take_output():
            sender.put(data, now)
        for extra in after:
            self._send_extra(extra, segments, 0, due, now)
        sender.packet_sent()
        sender.line.end_cycle(now)
        works.sonar.start_cycle(now)
        return due

    def _send_extra(self, extra: Extra, segments: tuple[int, int], reserved: int, due: Nanos, now: Nanos) -> None:
        """Send an extra packet if it leaves room for `reserved` bytes more before the next packet is due."""
        requests, line = self.works.requests, self._sender.line
        if not line.fits(reserved + SMALLEST_FRAME, now, due) and not requests.must_go(extra):
            requests.no_room(extra)
            return
        data = packet_frame(
            MAKERS[extra](self.works, self.settings.flash, segments, now), self.settings.profile
        ).to_bytes()
        if not line.fits(reserved + len(data), now, due) and not requests.must_go(extra):
            requests.no_room(extra)
            return
        requests.sent(extra)
        self._sender.put(data, now)

    def _bumpers_told(self, segments: tuple[int, int]) -> tuple[int, int]:
        """Return front and rear as the standard packet has them: without bumpers a P2OS robot reads ones."""
        flash = self.settings.flash
        floating = 0 if self.settings.profile.has_flags else BUMPERS_NOT_FITTED
        fitted = flash.number("frontbumps"), flash.number("rearbumps")
        return (
            segments[0] if fitted[0] or segments[0] else floating,
            segments[1] if fitted[1] or segments[1] else floating,
        )
