"""Lines of a trace: what a damaged one is, and what later and older versions write."""

import json

import pytest

from robot_bench.events.codec import (
    LAST_NS,
    Blocks,
    EdgeBlock,
    Levels,
    TraceError,
    damaged,
    entries_of,
    event_of,
    events_of,
)
from robot_bench.events.kinds import Contact, Note, PinEdge, Ranges, Wave, WorldChange

WAVE = {"k": "wave", "t": 5, "net": "pwm", "at": 0, "period": 10, "high": 3, "hz": 1000}
PLACE = {"k": "obstacle", "t": 5, "op": "place", "name": "box", "x": 1, "y": 2, "length": 3, "width": 4}
PINS = {"k": "pins", "t": 0, "v": 1, "nets": ["a", "b"], "levels": "01"}
CLEAR = {"k": "clearance", "t": 5, "um": 7}
DAMAGED = r"^the trace:2: a damaged line\nhint: cut the file before it: what stands above it is reported$"
PIN = {"k": "pin", "t": 5, "net": "a", "v": 1}


@pytest.mark.parametrize(
    ("entry", "change"),
    [
        (CLEAR, {"t": -1}), (CLEAR, {"t": LAST_NS + 1}), (CLEAR, {"um": "7"}), (CLEAR, {"um": 1e300}),
        (CLEAR, {"um": None}), (CLEAR, {"um": float("nan")}),
        (PIN, {"v": 2}), (PIN, {"v": -1}), (PIN, {"net": ...}),
        (WAVE, {"hz": 0}), (WAVE, {"high": 0}), (WAVE, {"high": 10}), (WAVE, {"at": -1}), (WAVE, {"at": 10}),
        (PINS, {"levels": "0"}), (PINS, {"levels": "02"}), (PINS, {"levels": "012"}),
        (PLACE, {"x": ...}), (PLACE, {"y": True}), (PLACE, {"length": ...}), (PLACE, {"width": "4"}),
        (PLACE, {"heading": "east"}), (PLACE, {"height": None}), (PLACE, {"radius": "r"}), (PLACE, {"kind": 1}),
        (PLACE, {"shape": 1}), (PLACE, {"shape": "cylinder"}), (PLACE, {"op": "move", "x": float("inf")}),
        (PLACE, {"x": 1e300}), (PLACE, {"name": ...}),
        ({"k": "wire", "t": 5, "dir": "c2c", "hex": ""}, {}), ({"k": "wire", "t": 5, "dir": "c2r", "hex": "0"}, {}),
        ({"k": "sonar", "t": 5, "mm": [1e300]}, {}), ({"k": "sonar", "t": 5}, {}),
        ({"k": "verdict", "t": 5, "goal": "a", "met": True, "says": "", "robustness": "x"}, {}),
    ],
)  # fmt: skip
def test_a_line_with_no_such_value_is_damaged(entry: dict[str, object], change: dict[str, object]) -> None:
    broken = {key: value for key, value in (entry | change).items() if value is not ...}
    with pytest.raises((KeyError, TypeError, ValueError)):
        event_of(broken)
    with pytest.raises(TraceError, match=DAMAGED):
        list(events_of(['{"k": "meta"}\n', json.dumps(broken) + "\n"]))


@pytest.mark.parametrize(
    ("entry", "event"),
    [
        (CLEAR | {"k": "of tomorrow"}, None), ({"t": 1}, None), ({"k": ["pin"], "t": 1}, None),
        (PLACE | {"op": "paint"}, None),
        (PLACE | {"op": "remove", "x": ...}, WorldChange(t=5, op="remove", name="box",
                                                       fields={"y": 2, "length": 3, "width": 4})),
        (PLACE | {"op": "move"}, WorldChange(t=5, op="move", name="box",
                                             fields={"x": 1.0, "y": 2.0, "length": 3, "width": 4})),
        (PLACE | {"shape": "cylinder", "radius": 1, "heading": 1, "length": ..., "width": ...},
         WorldChange(t=5, op="place", name="box", fields={"x": 1.0, "y": 2.0, "shape": "cylinder", "radius": 1.0,
                                                          "heading": 1.0})),
        (WAVE | {"high": 9, "at": 9}, Wave(t=5, wire="pwm", at=9, period=10, high=9, ticks_hz=1000)),
        (WAVE | {"period": 0, "hz": 0}, Wave(t=5, wire="pwm", at=0, period=0, high=3, ticks_hz=0)),
        (PIN | {"t": LAST_NS}, PinEdge(t=LAST_NS, wire="a", level=True)),
        (PIN | {"t": 0, "v": 0}, PinEdge(t=0, wire="a", level=False)),
        ({"k": "sonar", "t": 5, "mm": [1, 2.0]}, Ranges(t=5, mm=(1, 2))),
        (PINS, Levels(t=0, nets=("a", "b"), levels="01")),
        ({"k": "pins", "t": 3, "n": 2, "d": "x"}, EdgeBlock(t=3, count=2, data="x")),
        ({"k": "event", "t": 5, "who": "a", "what": "b"}, Note(t=5, who="a", what="b")),
        ({"k": "contact", "t": 5, "what": "w", "x": 1500000, "y": -1}, Contact(t=5, what="w", x_m=1.5, y_m=-1e-6)),
    ],
)  # fmt: skip
def test_a_line_of_any_version_is_read(entry: dict[str, object], event: object) -> None:
    assert event_of({key: value for key, value in entry.items() if value is not ...}) == event


def test_edges_of_a_later_version_are_refused_as_such() -> None:
    with pytest.raises(TraceError, match=r"^mine:1: edges as a later version writes them\nhint: install a newer p2os$"):
        list(events_of([json.dumps(PINS | {"v": 9}) + "\n"], "mine"))


def test_a_block_with_other_edges_than_it_says_is_damaged() -> None:
    blocks = Blocks()
    blocks.begin(Levels(t=0, nets=("a",), levels="0"))
    with pytest.raises(ValueError, match="a block has not as many edges as it says"):
        list(blocks.take(EdgeBlock(t=3, count=1, data="")))


@pytest.mark.parametrize("end", ['{"k": 1}', "[]\n", "{\n", "[" * 100_000 + "\n"])
def test_what_follows_a_line_that_is_cut_is_not_read(end: str) -> None:
    assert list(entries_of(['{"k":1}\n', end, '{"k":2}\n'])) == [{"k": 1}]
    assert str(damaged("x", 3)).splitlines()[0] == "x:3: a damaged line"
