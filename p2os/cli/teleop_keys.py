"""Keys to speeds, with a deadman: no key for a while and the robot stops.

Theory of operation. A terminal tells when a key is pressed and repeats it while
it is held, but never that it was let go. The first press drives for as long as
keyboards take to begin to repeat; each repetition drives on for a shorter time.
So a tap is a short push, a held key drives, and a key let go, a terminal that
hangs or a person who walks away stop the robot.

Passive: keys and times are passed in.
"""

from collections.abc import Mapping

from p2os.timing import NS_PER_MS, Nanos

#: Keyboards begin to repeat after 250 to 660 ms (X11's default is 660 ms).
FIRST_HOLD_NS: Nanos = 700 * NS_PER_MS
#: chosen: keyboards repeat every 25 to 50 ms; slow links bunch the repetitions up.
NEXT_HOLD_NS: Nanos = 300 * NS_PER_MS
#: chosen: two presses nearer than this are a held key.
REPEAT_NS: Nanos = 250 * NS_PER_MS
#: Each press of + or - changes the speeds by so much.
FACTOR = 1.1
SLOWEST, FASTEST = 0.05, 1.0

#: Key → (forward, turn), in shares of the chosen speeds.
KEYS: Mapping[str, tuple[float, float]] = {
    "up": (1, 0), "down": (-1, 0), "left": (0, 1), "right": (0, -1),
    "w": (1, 0), "s": (-1, 0), "a": (0, 1), "d": (0, -1),
    "i": (1, 0), ",": (-1, 0), "j": (0, 1), "l": (0, -1),
    "u": (1, 1), "o": (1, -1), "m": (-1, -1), ".": (-1, 1),
}  # fmt: skip
STOP_KEYS = (" ", "k", "x")
QUIT_KEYS = ("q", "escape", "\x03", "\x04")
#: What terminals send for the arrow keys.
SEQUENCES: Mapping[str, str] = {
    "\x1b[A": "up", "\x1b[B": "down", "\x1b[C": "right", "\x1b[D": "left",
    "\x1bOA": "up", "\x1bOB": "down", "\x1bOC": "right", "\x1bOD": "left",
}  # fmt: skip


def split_keys(text: str) -> list[str]:
    """Return the keys that a terminal's characters stand for."""
    keys, place = [], 0
    while place < len(text):
        sequence = text[place : place + 3]
        if sequence in SEQUENCES:
            keys.append(SEQUENCES[sequence])
            place += 3
        elif text[place] == "\x1b" and text[place + 1 : place + 2] in {"[", "O"}:
            end = next(
                (at for at in range(place + 2, len(text)) if text[at].isalpha() or text[at] == "~"), len(text) - 1
            )
            place = end + 1  # a key that means nothing here
        else:
            keys.append("escape" if text[place] == "\x1b" else text[place].lower())
            place += 1
    return keys


class Teleop:
    """What the keys want of the robot.

    Args:
        forward_mps: Speed of a full step, m/s.
        turn_radps: Turning speed of a full step, rad/s.
    """

    def __init__(self, forward_mps: float, turn_radps: float) -> None:
        self._forward_mps, self._turn_radps = forward_mps, turn_radps
        self.share = 1.0
        self.is_over = False
        self._wanted = (0.0, 0.0)
        self._key = ""
        self._pressed_ns: Nanos = 0
        self._until: Nanos | None = None

    @property
    def is_driving(self) -> bool:
        """Whether a key is held."""
        return self._until is not None

    @property
    def speeds(self) -> tuple[float, float]:
        """What the robot should do now: m/s forward, rad/s counter-clockwise."""
        if self._until is None:
            return 0.0, 0.0
        return self._wanted[0] * self._forward_mps * self.share, self._wanted[1] * self._turn_radps * self.share

    def press(self, key: str, now: Nanos) -> None:
        """Take a key."""
        self.advance_to(now)
        if key in QUIT_KEYS:
            self.is_over = True
            self._until = None
        elif key in STOP_KEYS:
            self._until, self._key = None, ""
        elif key in {"+", "="}:
            self.share = min(FASTEST, self.share * FACTOR)
        elif key in {"-", "_"}:
            self.share = max(SLOWEST, self.share / FACTOR)
        elif key in KEYS:
            is_repeated = key == self._key and now - self._pressed_ns < REPEAT_NS
            hold = NEXT_HOLD_NS if is_repeated else FIRST_HOLD_NS
            self._wanted, self._key, self._pressed_ns = KEYS[key], key, now
            self._until = max(now + hold, self._until or 0) if is_repeated else now + hold

    def next_deadline(self) -> Nanos | None:
        """Return when the deadman stops the robot."""
        return self._until

    def advance_to(self, now: Nanos) -> None:
        """Stop if no key came in time."""
        if self._until is not None and now >= self._until:
            self._until = None
