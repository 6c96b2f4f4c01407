"""Nets with waves: the level at a time, the wave at a time, and edges for who wants them."""

from array import array

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.pins import PinMode
from bluepill_sim.fabric.subscriptions import Wave
from p2os.errors import LocalProtocolError
from robot_bench.wires.chip_pins import OWNER, ChipPins
from robot_bench.wires.nets import RELEASED, Contention, Harness, Net, Strength, WaveDrive
from simbase.timing import NS_PER_S
from tests.robot_bench.wires.fake_chip import PortsChip

QUICK = settings(max_examples=60)
PP, PULL = Strength.PUSH_PULL, Strength.PULL
#: 20 kHz of 72 MHz, high for a quarter, from tick 0 on.
WAVE = Wave(ns=0, at=0, period=3600, high=900, ticks_hz=72_000_000)
DRIVE = WaveDrive(WAVE, PP.codes)


def joined() -> tuple[PortsChip, Net, ChipPins]:
    chip, harness = PortsChip("PA0", "PA1"), Harness([Net("pwm"), Net("in")])
    chip.pins["PA0"].configure(PinMode.ALTERNATE_PUSH_PULL, output_bit=False)
    return chip, harness["pwm"], ChipPins(chip, harness, {"pwm": "PA0", "in": "PA1"})  # type: ignore[arg-type]


def test_a_wave_is_one_drive_and_its_level_is_that_of_the_time() -> None:
    net = Net("pwm")
    net.wave_from("chip", DRIVE, 100)
    # Rising edges each 50 µs, falling ones 12.5 µs later.
    assert [net.level(at) for at in (99, 100, 12_499, 12_500, 49_999, 50_000)] == [
        False,
        True,
        True,
        False,
        False,
        True,
    ]
    assert net.wave(99) is None
    assert net.wave(100) == WAVE
    assert (WAVE.frequency_hz, WAVE.duty) == (20_000, 0.25)
    net.drive("chip", True, PP, 60_000)
    assert net.wave(59_999) == WAVE
    assert net.wave(60_000) is None
    assert net.course(0, 100_000) == [(0, False), (100, WAVE), (60_000, True)]
    assert net.course(100, 60_000) == [(100, WAVE)], "until before the end"
    assert net.course(99, 101) == [(99, False), (100, WAVE)]


def test_edges_of_a_net_have_a_wave_as_low_and_its_changes_are_reported_once() -> None:
    net = Net("pwm", idle=True)
    net.wave_from("chip", DRIVE, 100)
    net.wave_from("chip", DRIVE, 200)  # the same: nothing new
    net.drive("chip", True, PP, 300)
    assert net.edges_until(150) == [(100, 0)]
    assert net.take_waves() == [(100, WAVE)]
    net.forget_before(150)
    assert net.level(49_999) is True, "driven high since 300"
    assert net.edges_until(400) == [(300, 1)]
    assert net.take_waves() == [(300, None)]
    net.forget_before(400)
    assert net.take_waves() == []
    net.wave_from("chip", DRIVE, 500)
    assert net.edges_until(600) == [(500, 0)]


def test_what_is_held_against_a_wave_is_no_wave_and_a_fight() -> None:
    net = Net("pwm")
    net.drive("chip", False, PP, 0)
    net.wave_from("chip", DRIVE, 10)
    net.drive("other", False, PP, 20)
    assert net.wave(20) is None
    assert net.level(1000) is False
    net.release("other", 30)
    assert net.wave(30) == WAVE
    net.edges_until(40)
    assert net.take_contentions() == [Contention(20, "pwm", ("chip", "other"))]
    assert net.take_waves() == [(10, WAVE), (20, None), (30, WAVE)]


def test_an_open_drain_wave_needs_a_pull() -> None:
    net = Net("pwm")
    net.wave_from("chip", WaveDrive(WAVE, (1, 0)), 0)
    assert net.wave(0) is None, "both phases are low"
    net.drive("board", True, PULL, 5)
    assert net.wave(5) == WAVE


def test_a_wave_that_comes_after_its_time_was_reported_is_refused() -> None:
    net = Net("pwm")
    net.edges_until(100)
    with pytest.raises(LocalProtocolError, match="at 100 ns after its edges up to 100 ns were reported"):
        net.wave_from("chip", DRIVE, 100)
    net.wave_from("chip", DRIVE, 101)


def test_a_snapshot_has_the_waves() -> None:
    net, other = Net("pwm"), Net("pwm")
    net.wave_from("chip", DRIVE, 10)
    other.restore(net.snapshot())
    assert other.wave(20) == WAVE
    assert other.snapshot() == net.snapshot()


@QUICK
@given(
    st.lists(
        st.tuples(st.integers(1, 5_000), st.booleans() | st.tuples(st.integers(2, 900), st.integers(1, 899))),
        min_size=1, max_size=8,
    ),
    st.integers(1, 6),
)  # fmt: skip
def test_a_net_of_the_chip_has_the_levels_of_its_pin_in_any_slices(
    script: list[tuple[int, bool | tuple[int, int]]], slices: int
) -> None:
    chip, net, _ = joined()
    pin, seen, end = chip.pin("PA0"), [], 0
    for wait, what in script:
        if isinstance(what, bool):
            pin.connect("TIM2_CH1", what)
        else:
            period, high = what[0], 1 + what[1] % (what[0] - 1) if what[0] > 2 else 1
            pin.offer_wave("TIM2_CH1", 7_000_000, period, high)
        seen += [(chip.now_ns, pin.level, pin.wave)]
        end = chip.now_ns + wait
        for part in range(1, slices + 1):
            chip.run(end - wait + wait * part // slices)
            seen.append((chip.now_ns, pin.level, pin.wave))
    chip.pins.deliver()
    last = {at: (level, wave) for at, level, wave in seen}
    assert {at: (net.level(at), net.wave(at)) for at in last} == last


def test_a_restored_chip_goes_on_with_its_wave_and_tells_nothing_new() -> None:
    chip, net, pins = joined()
    chip.pin("PA0").offer_wave("TIM2_CH1", 7_000_000, 350, 100)
    chip.run(1000)
    net.edges_until(999)
    assert len(net.take_waves()) == 1
    pins.chip_restored()
    chip.run(2000)
    net.edges_until(1999)
    assert net.take_waves() == []
    assert net.wave(1999) == chip.pin("PA0").wave


@pytest.mark.parametrize(
    ("mode", "codes"),
    [(PinMode.ALTERNATE_PUSH_PULL, PP.codes), (PinMode.ALTERNATE_OPEN_DRAIN, (PP.codes[0], RELEASED))],
)
def test_a_wave_of_the_chip_drives_its_net_in_both_phases_as_the_pin_does(
    mode: PinMode, codes: tuple[int, int]
) -> None:
    chip, net, _ = joined()
    chip.pins["PA0"].configure(mode, output_bit=False)
    chip.pin("PA0").offer_wave("TIM2_CH1", 7_000_000, 350, 100)
    chip.run(1000)
    chip.pins.deliver()
    drive = net.drive_at(OWNER, 1000)
    assert drive is not None
    assert drive.codes == codes


def test_levels_ahead_of_the_chip_reach_it_at_their_times() -> None:
    chip, _, pins = joined()
    net = pins._nets[1]
    chip.run(100)
    net.drive("robot", False, PP, 90)
    net.drive_in_turn("robot", array("q", (95, 150, 200)), bytes([2, 1, 2]))
    levels = []
    for at in (100, 149, 150, 199, 200):
        chip.run(at)
        levels.append(chip.pin("PA1").level)
    assert levels == [True, True, False, False, True]
    with pytest.raises(LocalProtocolError, match="lets in go ahead of the chip"):
        net.drive_in_turn("robot", array("q", (250, 300)), bytes([0, 1]))


def test_who_begins_to_wait_for_edges_gets_those_of_a_wave_from_then_on_and_no_others() -> None:
    chip, net, _ = joined()
    seen: list[int] = []
    pins = ChipPins(chip, Harness([net]), {"pwm": "PA0"}, on_watched=seen.append)  # type: ignore[arg-type]  # a part
    # Up each 100 ns, down 40 ns later.
    chip.pin("PA0").offer_wave("TIM2_CH1", NS_PER_S, 100, 40)
    chip.run(250)
    assert net.wave(250) is not None
    pins.watch(frozenset({"pwm"}), 130)
    assert seen == [140, 200, 240], "the chip stands at 250 already"
    chip.run(420)
    assert seen == [140, 200, 240, 300, 340, 400]
    assert [net.level(at) for at in (199, 200, 240, 299, 300, 399, 400)] == [
        False,
        True,
        False,
        False,
        True,
        False,
        True,
    ]
    assert net.wave(420) is None
    assert chip.stops > 0
    pins.watch(frozenset(), 420)
    chip.run(1000)
    assert net.wave(1000) == chip.pin("PA0").wave
    assert seen[-1] == 400
    assert net.level(440) is False
