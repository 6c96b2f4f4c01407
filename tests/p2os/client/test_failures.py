"""What goes wrong between a client and a robot: what the program learns, and that the robot stops and stays.

Every story drives at 0.4 m/s, meets its mishap, and goes on for ten seconds in
which the program asks for nothing. The robot has to begin to stop at its own
watchdog or earlier, and not to move again until it is asked: the first call
after a loss raises, the second moves.
"""

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from p2os.client.notices import Connected, DeadmanStopped, LinkLost, LinkLostError, Notice, PacketArrived
from p2os.protocol.commands import CommandNumber, stop, vel
from tests.p2os.client.client_rig import MS, Link, Rig, S

SPEED_MPS = 0.4
WATCHDOG_NS = 2 * S
STEP_NS = 10 * MS


@dataclass(frozen=True)
class Mishap:
    """One story: what happens, what clears it and when, and what the program is told."""

    name: str
    baud: int | None
    happen: Callable[[Rig], None]
    clear: Callable[[Rig], None] = lambda _rig: None
    mended_after_s: float = 3.0
    reported: str | None = None


def cut(rig: Rig) -> None:
    rig.is_cut = True


def join(rig: Rig) -> None:
    rig.is_cut = False


def reboot_at_another_rate(rig: Rig) -> None:
    rig.reboot()
    rig.robot_baud = 38400


def garble(rig: Rig) -> None:
    rig.robot_baud = 115200


def ungarble(rig: Rig) -> None:
    rig.robot_baud = 9600


MISHAPS = [
    Mishap("serial cable pulled and put back", 9600, Rig.pull, Rig.plug, reported="the line vanished"),
    Mishap("network cable pulled, the system notices", None, Rig.pull, Rig.plug, reported="the line vanished"),
    Mishap("wire loose, nobody is told", 9600, cut, join, reported="no packet for 1000 ms"),
    Mishap("half-open TCP peer", None, cut, join, reported="no packet for 1000 ms"),
    Mishap("wire loose for a moment", 9600, cut, join, 0.5),
    Mishap("robot reboots", 9600, Rig.reboot, reported="no packet for 1000 ms"),
    Mishap("robot reboots behind a network box", None, Rig.reboot, reported="no packet for 1000 ms"),
    Mishap("robot comes back at another rate", 9600, reboot_at_another_rate, reported="no packet for 1000 ms"),
    Mishap("line turns to noise for a while", 9600, garble, ungarble, reported="no packet for 1000 ms"),
]


class Watch:
    """Looks at the robot's wheels every 10 ms."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.speeds: list[tuple[int, float]] = []

    def living(self, seconds: float) -> "Watch":
        """Go on, as a program that waits and makes no motion call."""
        rig, end = self.rig, self.rig.now + round(seconds * S)
        while rig.now < end:
            rig.core.touch(rig.now)
            rig.run(STEP_NS / S)
            self.speeds.append((rig.now, max(map(abs, rig.wheels))))
        return self

    def began_to_stop_ns(self, since: int) -> int:
        return next(at for at, speed in self.speeds if at >= since and speed < SPEED_MPS - 1e-9) - since

    def moves_again(self) -> bool:
        """Tell whether the wheels' speed ever rose."""
        return any(late > early + 1e-9 for (_, early), (_, late) in zip(self.speeds, self.speeds[1:], strict=False))


def driving(baud: int | None) -> Rig:
    rig = Rig(baud=baud).connect()
    rig.core.set_velocity(SPEED_MPS, 0.0, rig.now)
    rig.living(2)
    assert rig.wheels == (SPEED_MPS, SPEED_MPS)
    return rig


@pytest.mark.parametrize("mishap", MISHAPS, ids=lambda mishap: mishap.name)
def test_the_robot_stops_by_its_watchdog_and_stays_until_it_is_asked(mishap: Mishap) -> None:
    rig = driving(mishap.baud)
    at, sent = rig.now, len(rig.sent)
    mishap.happen(rig)
    watch = Watch(rig).living(mishap.mended_after_s)
    mishap.clear(rig)
    watch.living(10)
    if mishap.reported is None:
        assert rig.notices(LinkLost) == []
        assert rig.wheels == (SPEED_MPS, SPEED_MPS), "a moment is no loss, and the speed was asked for"
        return
    assert rig.notices(LinkLost) == [LinkLost(mishap.reported)]
    assert watch.began_to_stop_ns(at) <= WATCHDOG_NS
    assert not watch.moves_again()
    assert rig.wheels == (0.0, 0.0)
    assert rig.core.link is Link.OPEN
    after = [command for command in rig.commands()[sent:] if command != vel(400)]
    first = after.index(stop())
    assert after[first : first + 2] == [stop(), vel(0)]
    assert not any(command.number in {CommandNumber.CLOSE, CommandNumber.OPEN} for command in after[:first])
    with pytest.raises(LinkLostError, match="the link was lost and is back"):
        rig.core.set_velocity(SPEED_MPS, 0.0, rig.now)
    rig.living(2)
    assert rig.wheels == (0.0, 0.0)
    rig.core.set_velocity(SPEED_MPS, 0.0, rig.now)
    rig.living(2)
    assert rig.wheels == (SPEED_MPS, SPEED_MPS)


@pytest.mark.parametrize("baud", [None, 9600])
def test_a_robot_that_streams_already_is_stopped_as_soon_as_it_is_heard(baud: int | None) -> None:
    first = driving(baud)
    second = Rig(baud=baud, pioneer=first.pioneer, now=first.now)
    second.pioneer.hang_up = lambda _now: None  # type: ignore[method-assign]  # it does not learn of a line's end
    second.core.connect(second.now)
    watch = Watch(second).living(8)
    # It is listened to for 250 ms on TCP, its first packet comes within 100 ms, and STOP is the first frame out.
    assert watch.began_to_stop_ns(first.now) <= 150 * MS
    assert not watch.moves_again()
    assert second.wheels == (0.0, 0.0)
    assert second.core.link is Link.OPEN
    assert second.commands()[:2] == [stop(), vel(0)]


def test_a_client_that_is_killed_leaves_the_watchdog_to_stop_the_robot() -> None:
    rig = driving(9600)
    killed_at = rig.now
    rig.core = Rig().core  # nobody is there any more
    watch = Watch(rig).living(6)
    assert watch.began_to_stop_ns(killed_at) <= WATCHDOG_NS
    assert rig.wheels == (0.0, 0.0)


def test_a_program_that_hangs_is_stopped_by_the_deadman_before_the_watchdog_could_know() -> None:
    rig = driving(9600)
    rig.run(6)
    assert [type(notice) for notice in rig.notices() if not is_chatter(notice)] == [DeadmanStopped]
    assert rig.wheels == (0.0, 0.0)
    assert rig.core.link is Link.OPEN


def is_chatter(notice: Notice) -> bool:
    return isinstance(notice, (Connected, PacketArrived)) or type(notice).__name__ == "ConfigurationKnown"
