"""Whether the motors are on, as far as anybody can know.

Motors are off after every OPEN. ENABLE has no answer; AROS and ARCOS robots say
in their flags whether the motors are on, P2OS robots do not. ENABLE is sent a
few times in a row, for a frame can be lost. Once they were on, motors that go
off were switched off by somebody at the robot: they stay off until the program
asks for them.
"""

from p2os.client.snapshots import RobotState
from p2os.timing import NS_PER_MS, Nanos

#: ENABLE goes out so often, so far apart.
ENABLE_TIMES, ENABLE_EVERY_NS = 3, 200 * NS_PER_MS
#: chosen: flags that say off are believed only so long after ENABLE: three packets.
GRACE_NS: Nanos = 800 * NS_PER_MS
#: Why motors went off, as the flags tell it.
BUTTON_IS_PRESSED, BUTTON_WAS_PRESSED = "the STOP button is pressed", "the STOP button was pressed"


class Motors:
    """The belief about the motors of one session after another."""

    def __init__(self) -> None:
        #: Whether this session was told ENABLE 1 and nothing has switched the motors off since.
        self.are_on = False
        #: Why they went off without being told, or None.
        self.taken_off: str | None = None
        self._left = 0
        self._due: Nanos | None = None
        self._asked_at: Nanos = 0

    def new_session(self) -> None:
        """Know that they are off."""
        self.are_on, self.taken_off = False, None
        self._left, self._due = 0, None

    def ask(self, *, on: bool, now: Nanos) -> None:
        """Note that ENABLE is being sent."""
        self.are_on, self.taken_off = on, None
        self._asked_at = now
        self._left = ENABLE_TIMES - 1 if on else 0
        self._due = now + ENABLE_EVERY_NS if self._left else None

    def next_deadline(self) -> Nanos | None:
        """Return when ENABLE is to be sent again."""
        return self._due

    def take_repeat(self, now: Nanos) -> bool:
        """Tell whether ENABLE is to be sent now."""
        if self._due is None or now < self._due:
            return False
        self._left -= 1
        self._due = now + ENABLE_EVERY_NS if self._left else None
        return True

    def take(self, state: RobotState, now: Nanos) -> str | None:
        """Take a state; return why the motors went off, once."""
        if state.motors_enabled:
            self._left, self._due = 0, None
        if self.taken_off == BUTTON_IS_PRESSED and not state.stop_button:
            self.taken_off = BUTTON_WAS_PRESSED
        if not self.are_on or state.motors_enabled is not False or now - self._asked_at < GRACE_NS:
            return None
        self.are_on = False
        self._left, self._due = 0, None
        self.taken_off = BUTTON_IS_PRESSED if state.stop_button else "they were switched off at the robot"
        return self.taken_off
