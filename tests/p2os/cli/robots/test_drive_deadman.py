"""What pages want of a robot: it stands when nothing is heard, and what was held then has to be let go first."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from p2os.cli.robots.drive_deadman import STILL, DriveDeadman
from p2os.view.run_control import DRIVE_HOLD_NS


def test_it_drives_until_nothing_was_heard_for_so_long_and_not_a_tick_longer() -> None:
    drive = DriveDeadman(0.3, 45.0)
    drive.ask(0.2, -10.0, 5)
    assert drive.speeds == (0.2, -10.0)
    drive.advance_to(5 + DRIVE_HOLD_NS - 1)
    assert drive.is_driving
    drive.advance_to(5 + DRIVE_HOLD_NS)
    assert drive.speeds == STILL
    drive.ask(0.2, 0.0, 6 + DRIVE_HOLD_NS)
    assert drive.speeds == STILL, "it is held still: nobody has pressed it anew"
    drive.ask(0.0, 0.0, 7 + DRIVE_HOLD_NS)
    drive.ask(0.2, 0.0, 8 + DRIVE_HOLD_NS)
    assert drive.is_driving


def test_it_is_no_faster_than_it_may_be_either_way() -> None:
    drive = DriveDeadman(0.3, 45.0)
    drive.ask(2.0, -360.0, 0)
    assert drive.speeds == (0.3, -45.0)


class DriveMachine(RuleBasedStateMachine):
    """Any pages, and a model of when something was held last."""

    def __init__(self) -> None:
        super().__init__()
        self.drive, self.now, self.heard, self.is_latched = DriveDeadman(0.3, 45.0), 0, -(10**12), False

    @rule(forward=st.floats(-2, 2), turn=st.floats(-360, 360))
    def ask(self, forward: float, turn: float) -> None:
        self._pass()
        self.drive.ask(forward, turn, self.now)
        if not forward and not turn:
            self.is_latched, self.heard = False, -(10**12)
        elif not self.is_latched:
            self.heard = self.now

    @rule()
    def stop(self) -> None:
        self.drive.stop()
        self.is_latched, self.heard = True, -(10**12)

    @rule(span=st.sampled_from([1, 50_000_000, DRIVE_HOLD_NS - 1, DRIVE_HOLD_NS]))
    def wait(self, span: int) -> None:
        self.now += span
        self._pass()
        self.drive.advance_to(self.now)

    def _pass(self) -> None:
        if self.heard >= 0 and self.now >= self.heard + DRIVE_HOLD_NS:
            self.is_latched, self.heard = True, -(10**12)

    @invariant()
    def drives_only_what_was_said_in_time(self) -> None:
        assert self.drive.is_driving == (self.now < self.heard + DRIVE_HOLD_NS)
        assert (self.drive.next_deadline() is None) == (not self.drive.is_driving)
        assert abs(self.drive.speeds[0]) <= 0.3
        assert abs(self.drive.speeds[1]) <= 45.0


TestDriveMachine = DriveMachine.TestCase
TestDriveMachine.settings = settings(max_examples=30, stateful_step_count=20)
