"""A pad by its reports: what it asks for, when it is lost, and what is left of it then."""

from p2os.gamepad import STICK_FULL, TRIGGER_FULL, Gamepad, PadReport


def test_a_pad_that_is_lost_asks_for_nothing_until_up_is_pressed_anew() -> None:
    pad = Gamepad(loss_ns=10)
    pad.take(PadReport(), 0)
    pad.take(PadReport(up=True, forward=TRIGGER_FULL, turn=-512), 1)
    assert (pad.wants_robot, pad.forward, pad.turn, pad.lost_at) == (True, TRIGGER_FULL, STICK_FULL, 11)
    pad.lose()
    assert (pad.wants_robot, pad.forward, pad.turn, pad.lost_at) == (False, 0, 0, None)
    pad.take(PadReport(up=True), 20)
    assert not pad.wants_robot, "it is held since before"
    pad.take(PadReport(), 21)
    pad.take(PadReport(up=True), 22)
    assert pad.wants_robot
