"""Each wire with each fault, made from the pin-out: the self-test names the wire, the fault and who takes part."""

from collections.abc import Iterable, Sequence
from itertools import pairwise, product

import pytest
from _pytest.mark.structures import ParameterSet

from adapter_sim.pinout import Pull, WireDirection, load_pinout
from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS
from robot_bench.wires.board_test.circuit import BoardFault, Side, WireFault
from robot_bench.wires.board_test.verdicts import BoardVerdict, VerdictRow
from tests.robot_bench.wires.board_test.conftest import Tested

PINOUT = load_pinout()
WIRES = [wire.name for wire in PINOUT.wires]
RESET = "rst"
PULLED_UP = {wire.name for wire in PINOUT.wires if wire.pull is Pull.UP}
#: Pads of each module, in the order in which they stand beside each other.
ROWS = {
    Side.BLUEPILL: (BLUEPILL_PINS[:20], BLUEPILL_PINS[20:]),
    Side.ESP32: tuple(ESP32_PINS[first : first + 10] for first in range(0, 40, 10)),
}
NAME_AT = {
    Side.BLUEPILL: {wire.bluepill: wire.name for wire in PINOUT.wires},
    Side.ESP32: {pin: wire.name for wire in PINOUT.wires if (pin := wire.esp32_pin("rev-b")) != "EN"},
}
Named = set[tuple[str, BoardVerdict, tuple[str, ...]]]


def neighbours(side: Side) -> list[tuple[str, str]]:
    """Return the wires whose pads stand beside each other on a module."""
    names = [[NAME_AT[side].get(pin, "") for pin in row] for row in ROWS[side]]
    return [(one, other) for row in names for one, other in pairwise(row) if one and other]


FAULTS = [
    *(BoardFault(WireFault.OPEN, wire) for wire in WIRES),
    *(BoardFault(WireFault.UNSOLDERED, wire) for wire in WIRES),
    *(BoardFault(WireFault.UNSOLDERED, wire, side=Side.ESP32) for wire in WIRES if wire != RESET),
    *(BoardFault(kind, wire, side=side) for kind in (WireFault.GND, WireFault.RAIL) for wire in WIRES for side in Side),
    *(BoardFault(WireFault.SHORT, *pair, side) for side in Side for pair in neighbours(side)),
    *(BoardFault(WireFault.SWAPPED, *pair) for pair in neighbours(Side.BLUEPILL)),
    *(BoardFault(WireFault.SWAPPED, *pair) for pair in neighbours(Side.ESP32)),
]  # fmt: skip
#: Faults on one board at once in these tests. chosen: more make no fewer groups, and a report is read at a glance.
MOST_AT_ONCE = 12


def grouped(faults: Iterable[BoardFault]) -> list[list[BoardFault]]:
    """Return the faults in groups that a board may have at once, each named as if it were alone.

    Currents of one wire are no other's, so those on different wires are independent, but for what they have in common:
    the reset, and the supply, which several pull-ups without their rail are taken for; at the rail they have it.
    """
    groups: list[list[BoardFault]] = []
    for fault in sorted(faults, key=lambda fault: not fault.other):  # those with two wires fit into fewer
        fitting = (group for group in groups if len(group) < MOST_AT_ONCE and are_independent([*group, fault]))
        group = next(fitting, None)
        if group is None:
            groups.append([fault])
        else:
            group.append(fault)
    return groups


def are_independent(faults: Sequence[BoardFault]) -> bool:
    """Tell whether no two faults have a wire in common, and neither the reset nor the supply."""
    wires = [wire for fault in faults for wire in (fault.wire, fault.other) if wire]
    low = {name for fault in faults if fault.kind is not WireFault.RAIL for name in (fault.wire, fault.other)}
    return len(set(wires)) == len(wires) and RESET not in wires and len(low & PULLED_UP) <= 1


#: One of each kind alone, and what is easily forgotten: the pin with the LED, a pull-up. Those of the reset are alone
#: in their groups.
QUICK = [
    BoardFault(WireFault.OPEN, "encoder2_s1"),
    BoardFault(WireFault.UNSOLDERED, "DD3", side=Side.ESP32),
    BoardFault(WireFault.GND, "motor1_comm1", side=Side.ESP32),
    BoardFault(WireFault.RAIL, "DD7"),
    BoardFault(WireFault.SHORT, "encoder1_s1", "motor1_comm3"),
    BoardFault(WireFault.SWAPPED, "DD1", "DD2"),
]


def expected(fault: BoardFault) -> list[Named]:
    """Return what may be named: more than one where no measurement can tell."""
    pair = {(fault.wire, (fault.other,)), (fault.other, (fault.wire,))}
    match fault.kind:
        case WireFault.SHORT:
            return [{(name, BoardVerdict.JOINED, others) for name, others in pair}]
        case WireFault.SWAPPED:
            return [{(name, BoardVerdict.SWAPPED, others) for name, others in pair}]
        case WireFault.GND:
            return [{(fault.wire, BoardVerdict.HELD, ("GND",))}]
        case WireFault.RAIL if fault.wire == RESET:
            return [{(fault.wire, BoardVerdict.HELD, ("3V3",)), ("supply", BoardVerdict.WRONG, ())}]
        case WireFault.RAIL:
            return [{(fault.wire, BoardVerdict.HELD, ("3V3",))}]
        case _:
            is_open: list[Named] = [{(fault.wire, BoardVerdict.OPEN, ())}]
            is_driven_here = PINOUT.wire(fault.wire).direction is WireDirection.TO_ADAPTER
            if fault.kind is WireFault.UNSOLDERED and fault.side is Side.ESP32 and is_driven_here:
                is_open.append({(fault.wire, BoardVerdict.HELD, ("GND",))})
            return is_open


def expected_of(faults: Sequence[BoardFault]) -> list[Named]:
    """Return what may be named of a board with several."""
    return [set().union(*each) for each in product(*(expected(fault) for fault in faults))]


def named(findings: list[VerdictRow]) -> Named:
    return {(row.name, row.verdict, row.others) for row in findings if row.is_fault}


def words(fault: BoardFault) -> str:
    return f"{fault.kind.value}-{fault.wire}-{fault.other or fault.side.value}"


def ids(faults: Sequence[BoardFault]) -> str:
    return words(faults[0]) + (f"-and-{len(faults) - 1}" if faults[1:] else "")


GROUPS = grouped(FAULTS)


def test_a_sound_board_has_a_row_for_each_wire_and_no_fault(tested: Tested) -> None:
    findings = tested()
    assert named(findings) == set()
    assert [row.name for row in findings] == ["supply", "crystal", *WIRES, "link", "pad"]
    assert [row.name for row in findings if row.verdict is not BoardVerdict.SOUND] == ["pad"]


@pytest.mark.parametrize("fault", QUICK, ids=words)
def test_one_fault_of_each_kind_is_named(tested: Tested, fault: BoardFault) -> None:
    assert named(tested(fault)) in expected(fault)


def either_way(groups: list[list[BoardFault]]) -> list[ParameterSet]:
    """Return each group with what a pad between the limits reads: one in every run, both of each in `make soak`."""
    return [
        pytest.param(
            group,
            between,
            id=f"{ids(group)}-reads-{between:d}",
            marks=[pytest.mark.soak] if place % 2 ^ between else [],
        )
        for place, group in enumerate(groups)
        for between in (False, True)
    ]


@pytest.mark.parametrize(("faults", "between"), either_way(GROUPS))
def test_each_fault_of_each_wire_is_named_however_a_pad_between_the_limits_reads(
    tested: Tested, faults: list[BoardFault], between: bool
) -> None:
    assert named(tested(*faults, between=between)) in expected_of(faults)


@pytest.mark.soak
@pytest.mark.parametrize("between", [False, True], ids=["reads-0", "reads-1"])
@pytest.mark.parametrize("fault", FAULTS, ids=words)
def test_a_fault_alone_is_named_however_a_pad_between_the_limits_reads(
    tested: Tested, fault: BoardFault, between: bool
) -> None:
    assert named(tested(fault, between=between)) in expected(fault)


@pytest.mark.slow
@pytest.mark.parametrize("between", [False, True], ids=["reads-0", "reads-1"])
def test_en_joined_to_its_neighbour_is_found(tested: Tested, between: bool) -> None:
    """The 20k of the wire and the 10k of EN make a level between the limits: EN is low, or falls with the wire."""
    findings = tested(BoardFault(WireFault.SHORT, "motor1_comm1", "EN", Side.ESP32), between=between)
    held: Named = {("supply", BoardVerdict.WRONG, ())}
    assert named(findings) == ({("motor1_comm1", BoardVerdict.JOINED, ("EN",))} if between else held)


def test_two_faults_are_both_named(tested: Tested) -> None:
    findings = tested(BoardFault(WireFault.OPEN, "DD1"), BoardFault(WireFault.SHORT, "motor2_comm1", "motor2_comm2"))
    assert named(findings) == {
        ("DD1", BoardVerdict.OPEN, ()),
        ("motor2_comm1", BoardVerdict.JOINED, ("motor2_comm2",)),
        ("motor2_comm2", BoardVerdict.JOINED, ("motor2_comm1",)),
    }


def test_without_the_loop_plug_the_line_is_not_tested(tested: Tested) -> None:
    row = next(row for row in tested(has_loop_plug=False) if row.name == "link")
    assert row.verdict is BoardVerdict.UNKNOWN
    assert "join pins 2 and 3" in row.detail
