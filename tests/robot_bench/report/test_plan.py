"""What is written on the plan of a run and on its plots."""

import pytest

from adapter_sim.pinout import load_pinout
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Contact, Packet
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import pin_labels
from robot_bench.report.drawn import drawn_of
from robot_bench.report.plan import LETTER_PX, LINE_PX, WIDE_PX, plan
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.records import S, pose

EXTENT = (-3.0, -3.0, 3.0, 3.0)
CRATE: Json = {"name": "crate", "shape": "box", "x": 1.0, "y": 1.0, "length": 0.8, "width": 0.4, "heading": 0.0}


def drawn(**changes: object) -> Json:
    """A plan of a robot that stands for 4 s, drives 2 m along x, and stands again to 16 s."""
    poses = [[t / 10, min(2.0, max(0.0, t / 40 - 1)), 0.0, 0.0] for t in range(161)]
    given = {"extent": EXTENT, "poses": poses, "obstacles": [CRATE], "changes": [], "hits": [], "duration_s": 16.0}
    return plan(**{**given, **changes})  # type: ignore[arg-type]


def texts(made: Json) -> list[str]:
    return [label["text"] for label in made["labels"]]  # type: ignore[index]


def test_a_robot_that_stands_has_one_mark_with_the_times_of_its_stay() -> None:
    made = drawn()
    assert made["times"] == [[2, 0.0, 0.0, 0.0, 4], [6, 0.5, 0.0, 0.0, 6], [8, 1.0, 0.0, 0.0, 8],
                             [10, 1.5, 0.0, 0.0, 10], [12, 2.0, 0.0, 0.0, 16]]  # fmt: skip
    assert texts(made)[:3] == ["start", "2–4 s", "6 s"]


def test_a_collision_is_named_with_its_time() -> None:
    assert "'crate', 8.7 s" in texts(drawn(hits=[(8.717, 1.35, -1.38, "'crate'")]))


def test_no_label_covers_another_or_leaves_the_plan() -> None:
    crowd = [{**CRATE, "name": f"crate {n}", "x": n % 7 * 0.5 - 1.5, "y": n // 7 * 0.3 - 1.5} for n in range(60)]
    scale, boxes = WIDE_PX / 6, []
    for label in drawn(obstacles=crowd, hits=[(n / 10, 0.02 * n, 0, "'wall'") for n in range(30)])["labels"]:  # type: ignore[index]
        width = LETTER_PX * len(label["text"])
        left = (label["x"] + 3) * scale + label["dx"] - {"left": 0, "center": width / 2, "right": width}[label["align"]]
        top = (3 - label["y"]) * scale + label["dy"] - LINE_PX / 2
        boxes.append((left, top, left + width, top + LINE_PX))
    assert len(boxes) > 10
    slack = 1.0  # offsets are rounded to pixels
    for n, (x0, y0, x1, y1) in enumerate(boxes):
        assert x0 > -slack < y0
        assert max(x1, y1) < WIDE_PX + slack
        for a0, b0, a1, b1 in boxes[:n]:
            assert x1 <= a0 + slack or a1 <= x0 + slack or y1 <= b0 + slack or b1 <= y0 + slack


def test_what_comes_and_goes_is_always_named_since_it_is_not_there_together() -> None:
    posts = [{"op": "place", "name": f"post {n}", "shape": "cylinder", "x": 0.5, "y": 0.5, "radius": 0.02, "t": n}
             for n in range(8)]  # fmt: skip
    assert {f"post {n}" for n in range(8)} < set(texts(drawn(changes=posts)))


def test_a_robot_that_leaves_the_extent_is_on_the_plan() -> None:
    assert drawn(poses=[[0.0, 0.0, 0.0, 0.0], [1.0, 5.0, -4.0, 0.0]])["bounds"] == (-3.0, -4.3, 5.3, 3.0)


def test_each_wire_is_labelled_with_its_pin_and_its_signal() -> None:
    labels = pin_labels()
    assert (labels["motor1_comm1"], labels["DD1"], labels["p2dx_con"]) == ("PB7 comm1", "PA4 DD1", "PB12 p2dx_con")
    assert set(labels) == {wire.name for wire in load_pinout().wires}


def hits(seconds: int) -> RunRecord:
    return RunRecord(
        meta={"scenario": "hit"}, poses=[pose(t=n * S) for n in range(seconds)], is_cut=False, last_ns=seconds * S,
        pins={"motor1_comm1": Edges([(0, 1)])}, contacts=[Contact(t=S, what="'crate'", x_m=1.0, y_m=0.0)],
        wire=[Packet(t=n * S, direction="c2r", data=bytes.fromhex("fafb03000000")) for n in range(seconds)],
    )  # fmt: skip


def test_the_plots_show_what_the_plan_says() -> None:
    pytest.importorskip("matplotlib")
    from robot_bench.report.plots import _path_figure, _pins_figure

    data = drawn_of(hits(9))
    written = {text.get_text() for text in _path_figure(data).axes[0].texts}
    assert written == {"1 m", *texts(data["plan"])}  # type: ignore[arg-type]  # an object
    assert [label.get_text() for label in _pins_figure(data).axes[0].get_yticklabels()] == [
        "PB7 comm1", "motor 1 (left)"
    ]  # fmt: skip
