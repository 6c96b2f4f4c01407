"""The chip's pins and the wires follow each other, each edge with its time."""

from robot_bench.wires.chip_pins import ChipPins
from robot_bench.wires.nets import Harness, Net, Strength
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

PP = Strength.PUSH_PULL


def joined(*script: tuple[int, str, PinDrive]) -> tuple[FakeChip, Net, list[int]]:
    chip, net, edges = FakeChip(script, block_ns=1), Net("DD1"), []
    net.drive("board", False, Strength.PULL, 0)
    ChipPins(chip, Harness([net]), {"DD1": "PA4"}, on_watched=edges.append).watch(frozenset({"DD1"}), 0)
    return chip, net, edges


def test_what_the_chip_drives_is_on_the_wire_from_that_time_on() -> None:
    chip, net, edges = joined((50, "PA4", PinDrive.HIGH), (60, "PA9", PinDrive.HIGH), (70, "PA4", PinDrive.NONE))
    for limit in (50, 60, 70):
        chip.advance_to(limit)
    assert [net.level(at) for at in (49, 50, 69, 70)] == [False, True, True, False]
    assert edges == [50, 70], "PA9 is on no wire"


def test_what_the_others_drive_reaches_the_pin() -> None:
    chip, net, _ = joined()
    net.drive("adapter", True, PP, 10)
    assert chip.pin("PA4").outside is True
    net.release("adapter", 20)
    assert chip.pin("PA4").outside is False, "the resistor on the wire"


def test_a_resistor_reaches_the_chip_as_one_and_never_fights_it() -> None:
    chip, net, _ = joined((50, "PA4", PinDrive.HIGH), (90, "PA4", PinDrive.PULL_UP))
    pin = chip.pin("PA4")
    assert (pin.outside, pin.is_weak) == (False, True)
    chip.advance_to(50)
    assert (pin.outside, pin.is_weak) == (False, True), "what the chip drives changes nothing outside"
    net.drive("adapter", False, PP, 60)
    assert (pin.outside, pin.is_weak) == (False, False), "a hard driver does fight"
    net.release("adapter", 70)
    assert (pin.outside, pin.is_weak) == (False, True)
    chip.advance_to(90)
    assert net.level(90) is False, "20 kΩ on the board win over the chip's own 40 kΩ"


def test_only_the_wires_that_are_watched_end_a_slice_and_are_reported() -> None:
    chip = FakeChip([(50, "PA4", PinDrive.HIGH), (60, "PA5", PinDrive.HIGH), (70, "PA4", PinDrive.LOW)], block_ns=1)
    edges: list[int] = []
    pins = ChipPins(chip, Harness([Net("DD1"), Net("DD2")]), {"DD1": "PA4", "DD2": "PA5"}, on_watched=edges.append)
    pins.watch(frozenset({"DD2"}), 0)
    assert chip.advance_to(100).now == 60
    pins.watch(frozenset(), 60)
    assert chip.advance_to(100).now == 100
    assert edges == [60]


def test_an_edge_between_the_time_of_who_begins_to_wait_and_that_of_the_chip_is_reported() -> None:
    chip = FakeChip([(50, "PA4", PinDrive.HIGH), (60, "PA4", PinDrive.LOW)], block_ns=1)
    edges: list[int] = []
    pins = ChipPins(chip, Harness([Net("DD1")]), {"DD1": "PA4"}, on_watched=edges.append)
    chip.advance_to(100)
    pins.watch(frozenset({"DD1"}), 50)
    assert edges == [60]
    pins.watch(frozenset({"DD1"}), 10)
    assert edges == [60], "once"


def test_pulls_of_the_chip_hold_a_wire_without_a_resistor() -> None:
    for drive, level in ((PinDrive.PULL_UP, True), (PinDrive.PULL_DOWN, False), (PinDrive.LOW, False)):
        chip, net = FakeChip([(5, "PA4", drive)], block_ns=1), Net("DD1", idle=not level)
        ChipPins(chip, Harness([net]), {"DD1": "PA4"})
        chip.advance_to(5)
        assert net.level(5) is level
