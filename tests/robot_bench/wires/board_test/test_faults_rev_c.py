"""Rev C: each fault of each wire is named, of its shift register's outputs too, which nothing on the board reads."""

from itertools import pairwise

import pytest

from robot_bench.wires.board_test.circuit import BoardFault, Side, WireFault
from robot_bench.wires.board_test.verdicts import BoardVerdict, VerdictRow
from tests.robot_bench.wires.board_test.conftest import Tested
from tests.robot_bench.wires.board_test.test_faults import (
    FAULTS,
    PINOUT,
    ROWS,
    either_way,
    expected_of,
    grouped,
    named,
    neighbours,
)

REVISION = "rev-c"
AT = {pin: wire.name for wire in PINOUT.wires if (pin := wire.esp32_pin(REVISION)) not in {None, "EN"}}
SHIFTED = {name for pin, name in AT.items() if pin.startswith("HC595.")}
#: Of the ESP32's pins, and of the register's.
NEIGHBOURS = [
    (AT[one], AT[other])
    for row in (*ROWS[Side.ESP32], tuple(f"HC595.Q{output}" for output in "ABCDEFGH"))
    for one, other in pairwise(row)
    if one in AT and other in AT
]
OF_REV_C = [
    *(fault for fault in FAULTS if not fault.other),
    *(BoardFault(WireFault.SHORT, *pair, Side.BLUEPILL) for pair in neighbours(Side.BLUEPILL)),
    *(BoardFault(WireFault.SHORT, *pair, Side.ESP32) for pair in NEIGHBOURS),
    *(BoardFault(WireFault.SWAPPED, *pair) for pair in (*neighbours(Side.BLUEPILL), *NEIGHBOURS)),
]


def reported(findings: list[VerdictRow]) -> set[str]:
    """Return the wires that are named."""
    return {row.name for row in findings if row.is_fault}


def test_a_sound_board_has_a_row_for_each_wire_and_no_fault(tested: Tested) -> None:
    findings = tested(revision=REVISION)
    assert named(findings) == set()
    assert [row.name for row in findings] == ["supply", "crystal", *(wire.name for wire in PINOUT.wires), "link", "pad"]
    assert next(row for row in findings if row.name == "DD3").path == "PA6 - HC595.QC"


@pytest.mark.parametrize(("faults", "between"), either_way(grouped(OF_REV_C)))
def test_each_wire_at_fault_is_named_and_no_other(tested: Tested, faults: list[BoardFault], between: bool) -> None:
    findings = tested(*faults, between=between, revision=REVISION)
    wanted = expected_of(faults)
    assert reported(findings) in [{name for name, _, _ in one} for one in wanted]
    # What is wrong at an output of the register is told as open: nothing reads it.
    at_register = [fault for fault in faults if fault.side is Side.ESP32 or fault.other]
    pairs = [{fault.wire, fault.other} for fault in at_register]
    blind = set[str]().union(*(pair for pair in pairs if pair & SHIFTED))
    exact = {row for row in named(findings) if row[0] not in blind}
    assert exact in [{row for row in one if row[0] not in blind} for one in wanted]
    assert all(row.verdict is not BoardVerdict.UNKNOWN for row in findings if row.name in blind)
