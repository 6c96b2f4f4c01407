"""A GPS receiver on a USART: NMEA 0183 sentences GGA and RMC, from where the board is in its world.

The world's x axis points east and its y axis north; an origin says where on Earth its (0, 0) lies.

Modelled: a rate of 1 to 10 Hz, the line's speed, the checksum, no fix for a while at first, speed and course over
ground, time of day from a start. *Chosen*: eight satellites, HDOP 1.0, five decimals of a minute (2 cm), a fix after
2 s. Not modelled: noise and drift, UBX and other commands (what it is sent is ignored), GSA, GSV and others.
Source: NMEA 0183 version 3.01, sentences GGA and RMC; WGS 84 for the radii of the ellipsoid.
Invariant: a sentence's fix is that of the moment at which its first character begins.

"""

import math
import re
from collections.abc import Sequence

from bluepill_sim.fabric.surroundings import BoardMotion
from bluepill_sim.parts.attached import Socket
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: WGS 84: half of the equator's diameter in metres, and the first eccentricity squared.
_EQUATOR_M, _ECCENTRICITY2 = 6_378_137.0, 6.694379990e-3
_KNOTS_PER_MPS = 3600 / 1852
MOST_HZ = 10
#: Of both sentences together with a fix; ten bits each on the line.
_SENTENCE_BYTES, _BITS = 150, 10
#: chosen: what every sentence without a better source says.
_SATELLITES, _HDOP = 8, 1.0


def with_checksum(body: str) -> bytes:
    """Return a sentence with its `$`, checksum and end."""
    checksum = 0
    for byte in body.encode("ascii"):
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n".encode("ascii")


class Gps(Stateful):
    """A receiver on a USART."""

    STATE = ("sent_count", "_next_ns")
    DERIVED = ("_socket",)

    def __init__(
        self, *, latitude_deg: float = 48.137, longitude_deg: float = 11.575, altitude_m: float = 520.0,
        rate_hz: int = 1, baud: int = 9600, fix_s: float = 2.0, start: str = "2026-01-01T00:00:00",
    ) -> None:  # fmt: skip
        """Make one.

        Args:
            latitude_deg: Where the world's origin lies; north is positive.
            longitude_deg: The same; east is positive.
            altitude_m: The same, above the sea.
            rate_hz: Fixes a second, 1 to 10.
            baud: Of its line.
            fix_s: How long after power-on it has a fix.
            start: UTC at power-on.

        Raises:
            ValueError: There is no such place, rate or time, or the line is too slow for the rate.
        """
        if not (abs(latitude_deg) < 90 and abs(longitude_deg) <= 180):
            raise ValueError(f"no place on Earth: {latitude_deg}, {longitude_deg}")
        if not 1 <= rate_hz <= MOST_HZ:
            raise ValueError(f"{rate_hz} fixes a second: 1 to {MOST_HZ}")
        if baud < (least := _SENTENCE_BYTES * _BITS * rate_hz):
            raise ValueError(f"{rate_hz} fixes a second do not fit into {baud} bit/s: {least} at the least")
        self._origin = (latitude_deg, longitude_deg, altitude_m)
        self._rate_hz, self._baud, self._fix_ns = rate_hz, baud, round(fix_s * NS_PER_S)
        self._start_s = _seconds_of(start)
        #: Fixes that were sent, those without a position too.
        self.sent_count = 0
        self._next_ns: Nanos = NS_PER_S // rate_hz
        self._socket: Socket | None = None

    def plug(self, socket: Socket) -> None:
        """Set the line's speed."""
        if socket.port is None:
            raise ValueError("it hangs on a USART: on=USART2")
        socket.port.far_baud = self._baud
        self._socket = socket

    def sent(self, rows: Sequence[tuple[int, Nanos]]) -> None:
        """Ignore what the chip sends."""

    def next_deadline(self) -> Nanos:
        """Return when the next fix is sent."""
        return self._next_ns

    def advance_to(self, now_ns: Nanos) -> None:
        """Send the fix that is due."""
        socket = self._socket
        if socket is None or socket.port is None:
            return
        self.sent_count += 1
        self._next_ns = NS_PER_S * (self.sent_count + 1) // self._rate_hz
        socket.port.receive(b"".join(self.sentences(socket.surroundings.motion(), now_ns)))

    def words(self) -> str:
        """Return what it has sent."""
        return f"{self.sent_count} fixes sent"

    def sentences(self, motion: BoardMotion, at_ns: Nanos) -> tuple[bytes, bytes]:
        """Return GGA and RMC of a motion at a time."""
        hundredths = self._start_s * 100 + at_ns // (NS_PER_S // 100)
        days, second = divmod(hundredths // 100, 86_400)
        clock = f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}.{hundredths % 100:02d}"
        year, month, day = _date_of(days)
        date = f"{day:02d}{month:02d}{year % 100:02d}"
        if at_ns < self._fix_ns:
            return with_checksum(f"GPGGA,{clock},,,,,0,00,99.99,,,,,,"), with_checksum(
                f"GPRMC,{clock},V,,,,,,,{date},,,N"
            )
        latitude, longitude = self.place(motion)
        at = f"{_minutes(latitude, 'NS', 2)},{_minutes(longitude, 'EW', 3)}"
        altitude_m = self._origin[2] + motion.z_m
        knots = abs(motion.forward_mps) * _KNOTS_PER_MPS
        ahead = motion.heading_rad if motion.forward_mps >= 0 else motion.heading_rad + math.pi
        course = round((90.0 - math.degrees(ahead)) % 360.0, 2) % 360.0
        return (
            with_checksum(f"GPGGA,{clock},{at},1,{_SATELLITES:02d},{_HDOP:.2f},{altitude_m:.1f},M,0.0,M,,"),
            with_checksum(f"GPRMC,{clock},A,{at},{knots:.3f},{course:.2f},{date},,,A"),
        )

    def place(self, motion: BoardMotion) -> tuple[float, float]:
        """Return latitude and longitude of a motion, degrees: on the plane that touches the ellipsoid at the origin."""
        latitude, longitude, altitude_m = self._origin
        sine = math.sin(math.radians(latitude))
        root = math.sqrt(1 - _ECCENTRICITY2 * sine * sine)
        north_m = _EQUATOR_M * (1 - _ECCENTRICITY2) / root**3 + altitude_m
        east_m = (_EQUATOR_M / root + altitude_m) * math.cos(math.radians(latitude))
        return latitude + math.degrees(motion.y_m / north_m), longitude + math.degrees(motion.x_m / east_m)


def _minutes(degrees: float, letters: str, width: int) -> str:
    """Return degrees as NMEA writes them: whole degrees, minutes with five decimals, and the half of the Earth."""
    steps = round(abs(degrees) * 60 * 100_000)
    whole, rest = divmod(steps, 60 * 100_000)
    return f"{whole:0{width}d}{rest // 100_000:02d}.{rest % 100_000:05d},{letters[degrees < 0]}"


def _seconds_of(start: str) -> int:
    """Return seconds since the beginning of the year 0 in the Gregorian calendar.

    Raises:
        ValueError: It is no time such as 2026-01-31T12:00:00.
    """
    found = re.fullmatch(r"(\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)", start)
    if found is not None:
        year, month, day, hour, minute, second = map(int, found.groups())
        is_there = 1 <= month <= 12 and hour < 24 and minute < 60 and second < 60
        days = _days_before(year, month) + day - 1 if is_there else -1
        if is_there and _date_of(days) == (year, month, day):
            return days * 86_400 + hour * 3600 + minute * 60 + second
    raise ValueError(f"{start!r} is no time such as 2026-01-31T12:00:00")


def _days_before(year: int, month: int) -> int:
    """Return the days from the beginning of the year 0 to that of a month."""
    leaps = (year + 3) // 4 - (year + 99) // 100 + (year + 399) // 400
    is_leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    months = (31, 28 + is_leap, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)
    return 365 * year + leaps + sum(months[: month - 1])


def _date_of(days: int) -> tuple[int, int, int]:
    """Return year, month and day of a number of days since the beginning of the year 0."""
    year = days * 400 // 146_097  # of the average length: one too few, or one too many
    year += (_days_before(year + 1, 1) <= days) - (_days_before(year, 1) > days)
    month = next(number for number in range(12, 0, -1) if _days_before(year, number) <= days)
    return year, month, days - _days_before(year, month) + 1
