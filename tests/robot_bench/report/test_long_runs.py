"""The page of an hour's run is of bounded size, keeps what stands out, and says what it leaves out."""

from array import array
from dataclasses import replace
from typing import Any, cast

import pytest

from p2os.protocol.packets import EncoderPacket
from robot_bench.events.kinds import Contact, Note, Packet, WorldChange
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.drawn import PIN_PIXELS, PIXELS, drawn_of
from robot_bench.report.run_page import render_run
from robot_bench.wires.edges import Edges
from tests.p2os.view.pages import ReadPage
from tests.robot_bench.recording.records import S, pose

MS = 10**6
PACKET = EncoderPacket(left_counts=5, right_counts=-7).to_frame().to_bytes()
MOST_BYTES = 2_000_000


def long_run(seconds: int) -> RunRecord:
    """All that can grow with time, faster than in any shipped scenario, with one thing that stands out in each."""
    poses = [pose(t=n * 50 * MS, x=n % 4000 * 1000, y=n % 3000 * 1000, left=187_500) for n in range(seconds * 20)]
    fast = len(poses) // 2 + 77  # where neither x nor y stands out
    poses[fast] = replace(poses[fast], left=999_000)
    sonar = [(n * 100 * MS, [1500 + n % 700] * 16) for n in range(seconds * 10)]
    sonar[len(sonar) // 3] = (sonar[len(sonar) // 3][0], [1500] * 15 + [123])
    nets = [f"DD{n}" for n in range(1, 9)] + [f"motor{m}_comm{n}" for m in (1, 2) for n in (1, 2, 3)]
    pins = {net: Edges() for net in nets}
    for edges in pins.values():
        edges.extend(array("q", range(0, seconds * S, 20 * MS)), b"\0\1" * (seconds * 25))
    return RunRecord(
        meta={"scenario": "long", "threshold_m": 0.6},
        poses=poses,
        sonar=sonar,
        pins=pins,
        usart=[(n * 100 * MS, f"line {n}\n".encode()) for n in range(seconds * 10)],
        wire=[Packet(t=n * 50 * MS, direction="r2c", data=PACKET) for n in range(seconds * 20)],
        events=[
            Note(t=n * 500 * MS, who="adapter", what="command", detail="VEL 188, RVEL 0 (motors 3, 3)")
            for n in range(seconds * 2)
        ],
        contacts=[Contact(t=seconds // 2 * S, what="'crate'", x_m=1.0, y_m=0.0)],
        changes=[WorldChange(t=n * 50 * MS, op="move", name="dog", fields={"x": 1.0, "y": n * 1e-3, "heading": 0.0})
                 for n in range(seconds * 20)],
        last_ns=seconds * S,
        is_cut=False,
    )  # fmt: skip


@pytest.fixture(scope="module", params=[15, pytest.param(60, marks=pytest.mark.soak)])
def long(request: pytest.FixtureRequest) -> RunRecord:
    """Return a run of so many minutes; the first leaves something out of each list already."""
    return long_run(request.param * 60)


@pytest.fixture(scope="module")
def page(long: RunRecord) -> ReadPage:
    return ReadPage(render_run(long))


def test_the_page_of_an_hour_is_bounded_and_says_what_it_leaves_out(page: ReadPage) -> None:
    assert len(page.text) < MOST_BYTES
    for kind in ("pose", "levels", "packets", "text", "things"):
        lines = [line for line in page.header["left_out"] if line.startswith(f"{kind} of ")]
        assert len(lines) == 1, kind
        assert lines[0].endswith("trace.jsonl has all")


def test_what_stands_out_is_kept(long: RunRecord, page: ReadPage) -> None:
    assert max(row[1] for row in page.rows("left")) == 0.999
    assert min(row[1] for row in page.rows("nearest echo")) == 0.123
    assert min(min(row[1]) for row in page.rows("sonar")) == pytest.approx(0.123)
    assert any(row[3] == "collision" for row in page.rows("events"))
    for name in ("pose", "P2OS", "usart1"):
        assert page.rows(name)[0][0] == 0
    assert page.rows("pose")[-1][0] == long.poses[-1].t
    assert page.rows("P2OS")[-1][0] == long.wire[-1].t
    edges = page.rows("PA4 DD1")
    assert sum(row[2] for row in edges) == len(long.pins["DD1"])


def test_plots_of_an_hour_are_drawn_of_bounded_many_rows_and_keep_what_stands_out(long: RunRecord) -> None:
    drawn = cast("dict[str, list[list[float]]]", drawn_of(long))
    assert max(row[4] for row in drawn["poses"]) == 0.999
    assert len(drawn["poses"]) <= 10 * PIXELS
    pins = [rows for _, nets in cast("list[Any]", drawn["pins"]) for _, rows in nets]
    assert pins
    for rows in pins:
        assert len(rows) <= 3 * PIN_PIXELS
        assert {level for _, level in rows[1:40]} == {0, 1}
    assert not drawn_of(replace(long, pins={"DD1": Edges()}))["pins"][0][1][0][1]  # type: ignore[index]  # JSON


def test_a_minute_is_shown_whole() -> None:
    run = long_run(60)
    run.pins = {net: edges[:200] for net, edges in run.pins.items()}
    page = ReadPage(render_run(run))
    assert page.header["left_out"] == []
    assert [len(page.rows(name)) for name in ("pose", "P2OS", "usart1")] == [1200, 1200, 600]
