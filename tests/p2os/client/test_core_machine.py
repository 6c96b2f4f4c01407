"""Any story of a client and a robot: every line, any request, any mishap, in virtual time.

Invariants: a search ends, open or with a name, within its bound; between a loss
and the next motion call that did not raise, every speed on the wire is zero; the
first frames after a loss are STOP and VEL 0; a robot that hears nothing stands.
"""

from collections.abc import Callable

from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from p2os.client.goals import DriveAxis, TurnAxis
from p2os.client.link import TRY_LIMIT_NS
from p2os.client.notices import LinkLostError, MotorsDisabledError
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.commands import stop, vel
from tests.p2os.client.client_rig import MS, WIRES, Link, Rig, S

MOVING = {C.VEL, C.RVEL, C.MOVE, C.HEAD, C.DHEAD, C.VEL2}
#: A robot that hears nothing: its watchdog of 2 s, and from 0.75 m/s at 0.3 m/s2 to a stand.
STANDS_AFTER_NS = 2 * S + 2_600 * MS


class Story(RuleBasedStateMachine):
    """One client, one robot, one line."""

    @initialize(wire=st.sampled_from(list(WIRES)), baud=st.sampled_from([None, 9600, 38400]), seed=st.integers(0, 9999))
    def begin(self, wire: str, baud: int | None, seed: int) -> None:
        self.rig = Rig(wire=wire, baud=baud, robot_baud=9600, seed=seed)
        self.is_allowed = False
        self.unheard_since: int | None = None
        self.seen_sent = 0

    def teardown(self) -> None:
        if hasattr(self, "rig"):
            self.rig.is_cut, self.rig.is_plugged, self.rig.wire = False, True, "perfect"
            self.rig.core.close(self.rig.now)
            self.rig.run(3)
            assert self.rig.core.link is Link.CLOSED
            assert not self.rig.is_open

    @rule(milliseconds=st.integers(0, 900), is_alive=st.booleans())
    def time_passes(self, milliseconds: int, is_alive: bool) -> None:
        (self.rig.living if is_alive else self.rig.run)(milliseconds / 1000)

    @rule()
    def much_time_passes(self) -> None:
        self.rig.living(4)

    @rule()
    def program_connects(self) -> None:
        self.rig.core.connect(self.rig.now)

    @rule()
    def program_closes(self) -> None:
        self.rig.core.close(self.rig.now)
        self.is_allowed = False

    @rule(forward=st.floats(-1, 1), turn=st.floats(-2, 2))
    def program_drives(self, forward: float, turn: float) -> None:
        self.move(lambda: self.rig.core.set_velocity(forward, turn, self.rig.now))

    @rule(goal=st.one_of(st.builds(DriveAxis, st.floats(-2, 2)), st.builds(TurnAxis, st.floats(-7, 7))))
    def program_has_a_goal(self, goal: DriveAxis | TurnAxis) -> None:
        self.move(lambda: self.rig.core.begin_goal(goal, None, None, self.rig.now))

    def move(self, call: Callable[[], object]) -> None:
        self.look()  # what has left until now left before this call
        try:
            call()
        except (LinkLostError, MotorsDisabledError):
            return
        self.is_allowed |= self.rig.core._mover.has_goal or not self.rig.core.commanded.are_zero

    @rule()
    def program_stops(self) -> None:
        if self.rig.core.link is Link.OPEN:
            self.rig.core.stop(self.rig.now)

    @rule(is_cut=st.booleans())
    def the_line_is_cut_or_cleared(self, is_cut: bool) -> None:
        self.rig.is_cut = is_cut

    @rule()
    def the_cable_is_pulled(self) -> None:
        self.rig.pull()

    @precondition(lambda self: hasattr(self, "rig"))
    @rule()
    def the_cable_is_put_back(self) -> None:
        self.rig.plug()

    @rule()
    def the_robot_reboots(self) -> None:
        self.rig.reboot()

    @rule(junk=st.binary(min_size=1, max_size=30))
    def the_line_hums(self, junk: bytes) -> None:
        if self.rig.is_open:
            self.rig.core.receive(junk, self.rig.now)

    @invariant()
    def all_is_well(self) -> None:
        if hasattr(self, "rig"):
            self.look()
            self.a_search_ends()
            self.a_robot_that_hears_nothing_stands()

    def look(self) -> None:
        """Go through what was sent since the last look, in order."""
        rig = self.rig
        rig.run(0)
        sent, losses = rig.commands(), set(rig.losses)
        for place in range(self.seen_sent, len(sent)):
            if place in losses:
                self.is_allowed = False
                assert sent[place : place + 2] in ([stop()], [stop(), vel(0)]), sent[place : place + 2]
            if not self.is_allowed and sent[place].number in MOVING:
                assert not sent[place].argument, sent[place - 3 : place + 1]
        self.seen_sent = len(sent)
        if losses and max(losses) >= len(sent):
            self.is_allowed = False

    def a_search_ends(self) -> None:
        """Each stretch of searching ends within the limit: the rig notes when each began."""
        assert max(self.rig.searches_ns, default=0) <= TRY_LIMIT_NS

    def a_robot_that_hears_nothing_stands(self) -> None:
        rig = self.rig
        hears = rig.is_open and not rig.is_cut and rig.is_plugged
        if hears:
            self.unheard_since = None
        elif self.unheard_since is None:
            self.unheard_since = rig.now
        elif rig.now - self.unheard_since > STANDS_AFTER_NS:
            assert rig.wheels == (0.0, 0.0)


Story.TestCase.settings = hypothesis_settings(max_examples=50, stateful_step_count=30)
TestStory = Story.TestCase
