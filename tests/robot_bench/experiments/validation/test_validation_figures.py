"""Figures, bounds, and values read out of recorded wires."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapter_sim.codec import motor_code
from adapter_sim.pinout import load_pinout
from robot_bench.events.kinds import Packet
from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Missing, loose, worst, worst_or_missing
from robot_bench.experiments.validation.signals import at, encoder_steps, motor_pairs, seen_spans, sent
from robot_bench.recording.run_record import RunRecord
from robot_bench.wires.edges import Edges

MS = 1_000_000


def figure(measured: float, bound: float = 2.0, *, expected: float = 10.0, name: str = "a bound") -> Figure:
    return Figure(
        group="pins", what="x", expected=expected, measured=measured, uncertainty=0, unit="mm",
        bound=FigureTolerance(name=name, value=bound, formula="2 mm"),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("measured", "met"), [(8.0, True), (7.999, False), (12.0, True), (12.001, False), (10.0, True)]
)
def test_a_difference_is_met_up_to_its_bound_and_no_further(measured: float, met: bool) -> None:
    assert figure(measured).is_met is met


def test_a_bound_of_zero_takes_nothing_but_the_expected_value() -> None:
    assert figure(10.0, 0.0).is_met
    assert figure(10.0, 0.0).share == 0
    assert not figure(10.001, 0.0).is_met
    assert figure(10.001, 0.0).share == math.inf


@given(st.lists(st.floats(0, 20), min_size=1))
def test_the_worst_figure_is_met_only_if_all_are(values: list[float]) -> None:
    figures = [figure(value) for value in values]
    found = worst(figures)
    assert found.is_met is all(one.is_met for one in figures)
    assert found.count == len(values)
    assert abs(found.difference) == max(abs(one.difference) for one in figures)


def test_figures_that_are_not_there_are_missing_and_no_success() -> None:
    found = worst_or_missing([], "wire", "VEL", "none came")
    assert found == Missing(group="wire", what="VEL", why="none came")


@pytest.mark.parametrize(("measured", "is_loose"), [(11.0, True), (11.001, False), (9.0, True), (8.9, False)])
def test_a_bound_is_loose_where_half_of_it_would_do(measured: float, is_loose: bool) -> None:
    assert (loose([figure(10.0), figure(measured)]) != {}) is is_loose
    assert loose([figure(measured, 0.0)]) == {}


def pins_of(rows: list[tuple[int, dict[str, int]]]) -> RunRecord:
    record = RunRecord()
    for t, levels in rows:
        for wire, level in levels.items():
            edges = record.pins.setdefault(wire, Edges())
            if not len(edges) or list(edges)[-1][1] != level:
                edges.append(t, bool(level))
    record.last_ns = rows[-1][0]
    return record


def levels(value: str, code: int) -> dict[str, int]:
    return {wire: code >> bit & 1 for bit, wire in enumerate(load_pinout().value(value).wires)}


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(-4, 3), st.integers(-4, 3)), min_size=1, max_size=20))
def test_motor_pairs_are_read_back_as_they_were_put_on_the_wires(pairs: list[tuple[int, int]]) -> None:
    rows = [
        (number * 10 * MS, levels("motor1", motor_code(left, 3)) | levels("motor2", motor_code(right, 3)))
        for number, (left, right) in enumerate(pairs)
    ]
    wanted: list[tuple[int, tuple[int, int]]] = []
    for number, pair in enumerate(pairs):
        if not wanted or wanted[-1][1] != pair:
            wanted.append((number * 10 * MS, pair))
    assert motor_pairs(pins_of(rows)) == wanted


def test_wires_of_one_value_that_change_within_a_millisecond_change_together() -> None:
    wires = load_pinout().value("motor1").wires
    record = pins_of(
        [(0, levels("motor1", 0) | levels("motor2", 0)), (10 * MS, {wires[0]: 1}), (11 * MS - 1, {wires[1]: 1})]
    )
    assert motor_pairs(record) == [(0, (0, 0)), (10 * MS, (3, 0))]
    record = pins_of(
        [(0, levels("motor1", 0) | levels("motor2", 0)), (10 * MS, {wires[0]: 1}), (11 * MS, {wires[1]: 1})]
    )
    assert motor_pairs(record) == [(0, (0, 0)), (10 * MS, (1, 0)), (11 * MS, (3, 0))]


@settings(max_examples=30)
@given(st.integers(0, 7), st.lists(st.sampled_from([-3, -2, -1, 1, 2, 3]), max_size=40))
def test_encoder_steps_are_counted_over_whole_turns_both_ways(first: int, changes: list[int]) -> None:
    counts = [first]
    for change in changes:
        counts.append(counts[-1] + change)
    rows = [(number * 10 * MS, levels("encoder1", count % 8)) for number, count in enumerate(counts)]
    assert encoder_steps(pins_of(rows), "encoder1", 0) == [(n * 10 * MS, count) for n, count in enumerate(counts)]


def test_what_an_encoder_shows_before_the_start_is_not_counted() -> None:
    rows = [(0, levels("encoder2", 4)), (10 * MS, levels("encoder2", 0)), (30 * MS, levels("encoder2", 7))]
    assert encoder_steps(pins_of(rows), "encoder2", 20 * MS) == [(20 * MS, 0), (30 * MS, -1)]


def test_a_span_lasts_while_any_of_the_wires_is_high() -> None:
    record = pins_of([
        (0, {"DD1": 0, "DD2": 0}), (10 * MS, {"DD1": 1}), (20 * MS, {"DD2": 1}), (30 * MS, {"DD1": 0}),
        (40 * MS, {"DD2": 0}), (50 * MS, {"DD1": 1}),
    ])  # fmt: skip
    assert seen_spans(record, ("DD1", "DD2"), 0) == [(10 * MS, 40 * MS), (50 * MS, 50 * MS)]
    assert seen_spans(record, ("DD1", "DD2"), 15 * MS) == [(15 * MS, 40 * MS), (50 * MS, 50 * MS)]


def test_commands_are_read_with_their_signs_and_noise_is_passed_over() -> None:
    record = RunRecord()
    record.wire = [
        Packet(t=1, direction="c2r", data=bytes.fromhex("fafb060b3bbb00c63b")),
        Packet(t=2, direction="c2r", data=bytes.fromhex("fafb060b1bfa00051b")),
        Packet(t=3, direction="r2c", data=bytes.fromhex("fafb060b1bfa00051b")),
        Packet(t=4, direction="c2r", data=b"\xfa\xfb\x06\x0b"),
    ]
    assert sent(record, 11) == [(1, 187), (2, -250)]
    assert sent(record, 21) == []


def test_a_course_has_no_value_before_it_begins() -> None:
    assert at([(10, "a"), (20, "b")], 9) is None
    assert at([(10, "a"), (20, "b")], 10) == "a"
    assert at([(10, "a"), (20, "b")], 19) == "a"
    assert at([(10, "a"), (20, "b")], 20) == "b"
