"""What is done to a bench by hand, in words: read and checked for that bench.

Invariant: what is returned is what a `[[hand]]` table with the same time does in a run from the beginning.
"""

from collections.abc import Iterable
from dataclasses import replace

from p2os.errors import ScenarioError
from robot_bench.bench import Bench
from robot_bench.scenario.hands.actions import WHEELS
from robot_bench.scenario.hands.timed import Hand, hand_at
from robot_bench.scenario.hands.words import meant_by
from simbase.errors import UsageError
from simbase.timing import Nanos

#: What hands do to a board.
BOARD_HANDS = frozenset({"set_pin", "set_volts", "type", "let_go"})


def hand_of(words: str, at: Nanos, bench: Bench) -> Hand:
    """Return what a line of words means, done at a time.

    Raises:
        UsageError: They mean nothing that can be done.
        ScenarioError: There is no such fault, button or pin here.
    """
    do, keys = meant_by(words)
    scenario = bench.scenario
    wires = None if scenario.own_robot is None else scenario.own_robot.wires
    if not scenario.has_robot and (do not in BOARD_HANDS or keys.get("what") == WHEELS):
        raise UsageError("a board by itself has neither robot nor world", hint="pin, volts, type, let go")
    found = hand_at(at, do, keys, scenario.parameters, "hand", wires)
    if found.doing.faults and bench.parts.controller is None:
        raise ScenarioError(
            "a fault acts on the robot's controller, and mode direct has none", hint="a run with --mode adapter"
        )
    return replace(found, words=words.strip())


def saved_as(words: str) -> str:
    """Return as what hands are to be saved.

    Raises:
        UsageError: As neither a scenario nor a test.
    """
    if words not in {"scenario", "test"}:
        raise UsageError(f"hands are not saved as {words!r}", hint="scenario or test")
    return words


def drive_words(speeds: tuple[float, float]) -> str:
    """Return the words of wheels that turn so: m/s ahead, degrees a second counter-clockwise."""
    return f"drive {speeds[0]:.3f} {speeds[1]:.1f}"


def driven_by(hands: Iterable[Hand], until: Nanos) -> tuple[float, float] | None:
    """Return how the wheels are driven by hand at a time, as of `drive_words`; None: they are not."""
    driven = None
    for hand in hands:
        if hand.at <= until and hand.do == "drive":
            driven = float(str(hand.keys["forward_mps"])), float(str(hand.keys["turn_dps"]))
        elif hand.at <= until and hand.keys.get("what") == WHEELS:
            driven = None
    return driven
