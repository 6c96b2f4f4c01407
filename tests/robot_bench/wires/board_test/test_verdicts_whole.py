"""Every verdict on a wire, by what it did when it was driven; and the voltages of a board with each fault."""

import itertools

from adapter_sim.pinout import load_pinout
from robot_bench.wires.board_test.circuit import BoardFault, Circuit, Side, VoltageSource, WireFault
from robot_bench.wires.board_test.verdicts import judge
from robot_bench.wires.board_test.walk import PATTERN, BoardMeasurement, Response
from tests.robot_bench.recording.kept_lines import is_as_kept

PINOUT = load_pinout()
NAMES = [wire.name for wire in PINOUT.wires]


def word(*names: str) -> int:
    return sum(1 << NAMES.index(name) for name in names)


def sound() -> dict[str, Response]:
    return {name: Response(bluepill=word(name), adapter=word(name)) for name in NAMES if name != "rst"} | {
        "rst": Response(bluepill=word("rst"), silent_at={True})
    }


def measured(**changes: object) -> BoardMeasurement:
    given = {"started_by": "power-on", "csr": 0, "has_crystal": True, "idle_bluepill": 0, "idle_adapter": (1 << 32) - 1,
             "wires": sound(), "link": PATTERN, "pad_reports": 3, "has_pad": True}  # fmt: skip
    return BoardMeasurement(**given | changes)  # type: ignore[arg-type]


def rows(found: BoardMeasurement, *names: str) -> list[str]:
    return [
        f"  {row.name} ({row.path}): {row.verdict.value}, {row.detail} {row.others} {row.is_fault}"
        for row in judge(found, PINOUT, "rev-b") if not names or row.name in names
    ]  # fmt: skip


def test_what_wires_are_found_to_be() -> None:
    lines = ["sound", *rows(measured())]
    for said in (
        {"started_by": None, "idle_adapter": None},
        {"started_by": None, "idle_bluepill": word("rst"), "has_pad": False},
        {"started_by": "brown-out"}, {"idle_adapter": 0}, {"has_crystal": False}, {"link": b""}, {"link": None},
        {"link": PATTERN[1:]}, {"link": b"x" + PATTERN}, {"has_pad": False}, {"pad_reports": 0},
    ):  # fmt: skip
        lines += [str(said), *rows(measured(**said), "supply", "crystal", "link", "pad", "rst", "DD1")]
    reset_also = [Response(), Response(silent_at={True, False}), Response(silent_at={False}),
                  Response(bluepill=word("DD1"), silent_at={True}), Response(bluepill=word("DD1", "DD2")),
                  Response(held_at=True), Response(held_at=False, silent_at={False}), Response(pulled={True: False}),
                  Response(bluepill=word("rst"), pulled={True: True})]  # fmt: skip
    for response in reset_also:
        lines += [str(response), *rows(measured(wires=sound() | {"rst": response}), "rst")]
    for name, other in (("DD1", "DD2"), ("DD3", "p2dx_con"), ("motor1_comm1", "motor2_comm1"), ("p2dx_con", "DD1")):
        words = (0, word(name), word(other), word(name, other))
        for bluepill, adapter in itertools.product(words, words):
            response = Response(bluepill=bluepill, adapter=adapter)
            lines += [f"{bluepill} {adapter}", *rows(measured(wires=sound() | {name: response}), name)]
        for silent in ({True}, {False}, {True, False}):
            for reads in (0, word("rst")):
                response = Response(silent_at=silent, bluepill=reads)
                lines += [str(response), *rows(measured(wires=sound() | {name: response}), name)]
        for near, far, held, pulled in itertools.product(
            (set[bool](), {True}, {False}), ({True}, {False}), (None, True, False), ({}, {False: True}, {True: False})
        ):
            response = Response(near_wrong=near, far_wrong=far, held_at=held, pulled=pulled)
            lines += rows(measured(wires=sound() | {name: response}), name)
    assert is_as_kept(lines, "verdicts_of_wires")


def test_voltages_of_a_board_with_each_fault() -> None:
    lines = []
    for kind, name, side in itertools.product(WireFault, ("DD1", "DD3", "rst", "encoder2_s1"), Side):
        for other in ("motor1_comm1", "EN") if kind is WireFault.SHORT else ("motor1_comm1",):
            board = Circuit(PINOUT, (BoardFault(kind, name, other, side),))
            for end, volts in itertools.product(Side, (0.0, 3.3)):
                pads = board.volts({(name, end): VoltageSource(volts, 50.0)})
                idle = Circuit(PINOUT).volts({})
                shown = [f"{node[0]}/{node[1]} {value:.4f}" for node, value in sorted(pads.items(), key=str)
                         if abs(value - idle[node]) > 1e-6]  # fmt: skip
                lines.append(f"{kind.value} {name} {other} {side}, {volts} at {end}: {', '.join(shown)}")
    assert is_as_kept(lines, "verdicts_of_voltages")
