"""The stream hands on each event once, in order, to whoever wants it; live and from a trace it is the same."""

import json
from dataclasses import fields, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError
from robot_bench.bench import Bench
from robot_bench.events.codec import LAST_NS, RANKS, Levels, event_of, events_of, line_of
from robot_bench.events.kinds import (
    HULL_PARTS,
    KINDS,
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
    hull_part,
)
from robot_bench.events.stream import EventStream
from robot_bench.events.words import distinguishing_words, what_of
from robot_bench.scenario.fault_script import FaultChange
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.world_script import Op, ScriptedChange
from robot_bench.wires.edges import Edges
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

S, MS = 10**9, 10**6
whole = st.integers(-(2**62), 2**62)
times = st.integers(0, LAST_NS)
words = st.text(max_size=8)
#: Micrometres are what a contact keeps.
metres = st.integers(-(10**9), 10**9).map(lambda um: um / 1e6)
SAMPLES: dict[type, st.SearchStrategy[Any]] = {
    PinEdge: st.builds(PinEdge, t=times, wire=words, level=st.booleans()),
    Wave: st.builds(Wave, t=times, wire=words, at=st.just(1), period=st.integers(3, 2**62), high=st.just(2),
                    ticks_hz=st.integers(1, 2**62)),
    Text: st.builds(Text, t=times, data=st.binary(max_size=9), port=st.sampled_from(["usart1", "usart3", "usb"])),
    SpiTransfer: st.builds(SpiTransfer, t=times, bus=st.sampled_from(["spi1", "spi2"]), begun=times, ended=times,
                           from_master=st.binary(max_size=9), from_slave=st.binary(max_size=9),
                           bits=st.sampled_from([8, 16])),
    I2cTransfer: st.builds(I2cTransfer, t=times, bus=st.sampled_from(["i2c1", "i2c2"]), begun=times,
                           address=st.integers(0, 1023), is_read=st.booleans(), data=st.binary(max_size=9),
                           answered=st.booleans(), acknowledged=st.integers(0, 9),
                           end=st.sampled_from(["stop", "restart", "lost", "cut", "more"])),
    CanTransfer: st.builds(CanTransfer, t=times, bus=st.just("can"), begun=times, identifier=st.integers(0, 2**29 - 1),
                           is_extended=st.booleans(), is_remote=st.booleans(), dlc=st.integers(0, 8),
                           data=st.binary(max_size=8), is_own=st.booleans(),
                           error=st.sampled_from(["", "acknowledge", "damaged"])),
    Packet: st.builds(Packet, t=times, direction=st.sampled_from(["c2r", "r2c"]), data=st.binary(max_size=9)),
    Pose: st.builds(Pose, t=times, **dict.fromkeys(
        ("x", "y", "z", "heading", "pitch", "left", "right", "left_angle", "right_angle", "collisions"), whole),
        work=st.none() | whole),
    Clearance: st.builds(Clearance, t=times, um=whole),
    Ranges: st.builds(Ranges, t=times, mm=st.lists(whole, max_size=9).map(tuple)),
    Contact: st.builds(Contact, t=times, what=words, x_m=metres, y_m=metres, part=st.sampled_from(HULL_PARTS)),
    Note: st.builds(Note, t=times, who=words, what=words.filter(lambda what: what != "collision"), detail=words),
    WorldChange: st.builds(WorldChange, t=times, op=st.just("move"), name=words,
                           fields=st.fixed_dictionaries({"x": metres, "y": metres, "heading": metres})),
    Fault: st.builds(Fault, t=times, op=st.sampled_from(["inject", "clear", "died"]), words=words),
    Verdict: st.builds(Verdict, t=times, goal=words, met=st.booleans(), says=words,
                       robustness=st.none() | metres, unit=words),
}  # fmt: skip


@given(st.one_of(*SAMPLES.values()))
def test_an_event_comes_back_from_its_line_which_is_what_the_encoder_of_json_makes_of_it(event: Event) -> None:
    line = line_of(event)
    assert event_of(json.loads(line)) == event
    assert list(events_of([line + "\n"])) == [event]
    assert line == json.dumps(json.loads(line), sort_keys=True, separators=(",", ":"))


def test_a_pose_of_an_older_trace_tells_no_work() -> None:
    line = line_of(pose(5, 7))
    assert '"w"' not in line
    assert event_of(json.loads(line)) == pose(5, 7)
    assert event_of(json.loads(line) | {"w": 0}) == replace(pose(5, 7), work=0)


def test_every_kind_of_event_is_tried_here() -> None:
    assert set(SAMPLES) == set(KINDS)


@given(st.data())
def test_two_events_that_differ_are_distinguished(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(KINDS))
    one, other = data.draw(SAMPLES[kind]), data.draw(SAMPLES[kind])
    name = data.draw(st.sampled_from([part.name for part in fields(one) if part.name != "t"]))
    other = replace(one, **{name: getattr(other, name)})
    ours, theirs = distinguishing_words(one, other)
    assert (ours == theirs) is (one == other), name
    assert ours.startswith(what_of(one))
    assert distinguishing_words(one, one) == (what_of(one), what_of(one))


def test_digits_and_bytes_that_words_leave_out_are_reported_where_events_differ_in_them() -> None:
    near, nearer = Clearance(t=5, um=1_476_312), Clearance(t=5, um=1_476_309)
    assert distinguishing_words(near, nearer) == (
        "1.476 m of clearance (1.476312 m)", "1.476 m of clearance (1.476309 m)",
    )  # fmt: skip
    assert distinguishing_words(near, Clearance(t=5, um=1_475_000)) == ("1.476 m of clearance", "1.475 m of clearance")
    ours, theirs = distinguishing_words(pose(0, 1), replace(pose(0, 1), left_angle=-7))
    assert ours.endswith("m/s (left angle 0.000000 rad)")
    assert theirs.endswith("m/s (left angle -0.000007 rad)")
    long = SpiTransfer(t=1, bus="spi1", begun=0, ended=1, from_master=bytes(20), from_slave=b"")
    ours, theirs = distinguishing_words(long, replace(long, from_master=bytes(18) + b"\1\0"))
    assert ours.endswith("(from_master from byte 18 on: 00 00)")
    assert theirs.endswith("(from_master from byte 18 on: 01 00)")
    thing = WorldChange(t=0, op="place", name="a", fields={"x": 1.0, "y": 2.0})
    other = replace(thing, fields={"x": 1.0, "z": 2.5})
    assert distinguishing_words(thing, other)[1] == "'a': place (fields: no y z 2.5)"
    ranges = Ranges(t=0, mm=(1000, 2))
    assert distinguishing_words(ranges, Ranges(t=0, mm=(1000, 1)))[0] == "sonar 1.00 0.00 m (mm: 2 2)"


notes = st.lists(
    st.tuples(st.integers(0, 40), st.sampled_from([Text, Note, Pose]), st.integers(0, 3)), max_size=20
).map(lambda rows: [made(*row) for row in sorted(rows, key=lambda row: row[0])])


def made(t: int, kind: type, value: int) -> Event:
    if kind is Text:
        return Text(t=t, data=bytes([value]))
    if kind is Note:
        return Note(t=t, who="x", what=str(value))
    return pose(t, value)


def pose(t: int, x: int = 0) -> Pose:
    return Pose(t=t, x=x, **dict.fromkeys(
        ("y", "z", "heading", "pitch", "left", "right", "left_angle", "right_angle", "collisions"), 0))  # fmt: skip


@given(notes, st.data())
def test_when_it_is_released_changes_nothing(events: list[Event], data: st.DataObject) -> None:
    at_once, in_pieces = [], []
    for seen, releases in ((at_once, False), (in_pieces, True)):
        stream = EventStream()
        stream.subscribe(seen.append)
        for event in events:
            stream.publish(event)
            if releases and data.draw(st.booleans()):
                stream.release(event.t - 1)
        stream.release(50)
    assert at_once == in_pieces
    assert sorted(at_once, key=lambda event: (event.t, RANKS[type(event)])) == at_once
    assert sorted(map(repr, at_once)) == sorted(map(repr, events))


def test_what_comes_after_its_time_was_handed_on_is_a_bug() -> None:
    stream = EventStream()
    stream.release(5)
    with pytest.raises(LocalProtocolError, match="a Note at 5 ns comes after 5 ns"):
        stream.publish(Note(t=5, who="x", what="y"))
    stream.publish(Note(t=6, who="x", what="y"))


def test_edges_become_events_on_wanted_wires_alone() -> None:
    stream, of_one, of_all = EventStream(), [], []
    end = stream.subscribe(of_one.append, PinEdge, Note, wires=["DD2"])
    assert [stream.wants_edges(wire) for wire in ("DD1", "DD2")] == [False, True]
    stream.subscribe(of_all.append, PinEdge)
    assert stream.wants_edges("DD1")
    stream.publish(Levels(t=0, nets=("DD1", "DD2"), levels="01"))
    stream.publish(Note(t=7, who="x", what="y"))
    stream.release(9, {"DD1": (0, Edges([(3, 1), (7, 0)])), "DD2": (1, Edges([(3, 0)]))})
    first, second = PinEdge(t=0, wire="DD1", level=False), PinEdge(t=0, wire="DD2", level=True)
    third = PinEdge(t=3, wire="DD2", level=False)
    assert of_one == [second, third, Note(t=7, who="x", what="y")]
    assert of_all == [first, second, PinEdge(t=3, wire="DD1", level=True), third, PinEdge(t=7, wire="DD1", level=False)]
    end()
    stream.release(12, {"DD2": (1, Edges([(11, 1)]))})
    assert len(of_one) == 3


def test_what_a_sink_publishes_comes_in_its_order() -> None:
    stream, seen = EventStream(), []
    late = Note(t=40, who="x", what="later")
    stream.subscribe(lambda at: [stream.publish(replace(late, t=at.t + after)) for after in (0, 1, 35)], Pose)
    stream.subscribe(lambda event: seen.append((event.t, type(event))))
    stream.publish(pose(5))
    stream.publish(Text(t=6, data=b"x"))
    stream.release(10)
    assert seen == [(5, Pose), (5, Note), (6, Text), (6, Note)]
    stream.release(39)
    assert seen[4:] == []
    stream.release(40)
    assert seen[4:] == [(40, Note)]


def test_a_restored_stream_goes_on_alike() -> None:
    first, second = EventStream(), EventStream()
    reported: list[list[Event]] = [[], []]
    for stream, seen in zip((first, second), reported, strict=True):
        stream.subscribe(seen.append)
    first.publish(pose(9))
    first.publish(Note(t=3, who="x", what="y"))
    first.release(5)
    second.restore(first.snapshot())
    for stream in (first, second):
        stream.publish(Text(t=9, data=b"x"))
        stream.release(9)
    assert reported[0][1:] == reported[1] == [Text(t=9, data=b"x"), pose(9)]


@pytest.mark.parametrize(
    ("turn", "part"), [(0, "front"), (0.9, "front left"), (1.57, "left"), (-3.1, "rear"), (-0.4, "front right")]
)
def test_a_part_of_the_hull_is_named_by_its_direction(turn: float, part: str) -> None:
    assert hull_part(turn) == part


def seen_live(made: Bench) -> list[Event]:
    seen: list[Event] = []
    made.events.subscribe(seen.append)
    made.run_until(made.end)
    made.finish()
    return seen


CRATE = load_scenario("sensors").changes[0]
scenarios = st.fixed_dictionaries(
    {
        "mode": st.sampled_from(["direct", "adapter"]),
        "speed": st.sampled_from([(3, 3), (-4, 1), (0, 0)]),
        "text": st.lists(st.tuples(st.integers(1, 900).map(lambda ms: ms * MS), st.binary(max_size=80)), max_size=3),
        "blinks": st.lists(st.integers(0, 900 * MS), unique=True, max_size=40),
        "crate_ms": st.none() | st.integers(1, 700),
        "fault": st.booleans(),
    }
)


def built(plan: dict[str, Any]) -> Bench:
    of: Scenario = load_scenario("motors").with_options(mode=plan["mode"], body="kinematic", duration_s=0.9)
    if plan["crate_ms"] is not None:
        crate = ScriptedChange(
            at=plan["crate_ms"] * MS, op=Op.PLACE, name="post 9", x_m=0.1, y_m=0.0,
            obstacle=replace(CRATE.obstacle, name="post 9", radius_m=0.3) if CRATE.obstacle else None,
        )  # fmt: skip
        of = replace(of, changes=(crate,))
    if plan["fault"] and plan["mode"] == "adapter":
        of = replace(of, faults=(FaultChange(S // 3, "fault line-noise 0.01"),))
    script = [(0, "PB13", PinDrive.LOW), (10, "PB12", PinDrive.HIGH)]
    for value, pins in zip(plan["speed"], (("PB7", "PB6", "PB5"), ("PA1", "PA2", "PA3")), strict=True):
        script += [(100 + b, p, PinDrive.HIGH if value >> b & 1 else PinDrive.LOW) for b, p in enumerate(pins)]
    script += [(t, "PA4", PinDrive.HIGH if n % 2 else PinDrive.LOW) for n, t in enumerate(sorted(plan["blinks"]))]
    chip = FakeChip(sorted(script), sorted(plan["text"]))
    return Bench(of, chip=chip, slice_ns=MS)


@settings(max_examples=10)
@given(scenarios)
def test_the_stream_of_a_live_run_is_the_one_read_from_its_trace(plan: dict[str, Any]) -> None:
    live, unseen = built(plan), built(plan)
    seen = seen_live(live)
    played = list(events_of(live.trace.lines()))
    assert next(((a, b) for a, b in zip_longest(seen, played) if a != b), None) is None
    unseen.run_until(unseen.end)
    unseen.finish()
    assert (unseen.trace.text, unseen.trace.sha256) == (live.trace.text, live.trace.sha256), "looking changes nothing"
    kinds = {type(event) for event in seen}
    assert {PinEdge, Pose} <= kinds


def test_a_trace_that_was_cut_at_any_byte_plays_back_as_far_as_it_goes(tmp_path: Path) -> None:
    made = built({"mode": "adapter", "speed": (3, 3), "text": [(MS, b"hello\n")], "blinks": [5, 700, 9000],
                  "crate_ms": 3, "fault": True})  # fmt: skip
    made.run_until("0.06 s")
    made.finish()
    text = made.trace.text
    heard = list(events_of([*text.splitlines(keepends=True)]))
    lengths = []
    for end in range(len(text) + 1):
        found = list(events_of(text[:end].splitlines(keepends=True)))
        if found != heard[: len(found)]:
            pytest.fail(f"cut after {end} bytes: {found[-1]}")
        lengths.append(len(found))
    assert lengths == sorted(lengths)
    assert (lengths[0], lengths[-1]) == (0, len(heard))
