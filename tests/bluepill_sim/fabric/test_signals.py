"""Volts on pins: what a signal is at any time, against its description in floating point."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.signals import Oscillation, Samples, Waveform

VOLTS = st.one_of(st.integers(-1_000_000, 5_000_000).map(lambda uv: uv / 1e6), st.sampled_from([-999.9, 999.9]))
QUICK = settings(max_examples=80)


def expected(one: Oscillation, at_ns: int) -> float:
    part = (at_ns + one.phase_ns) % one.period_ns / one.period_ns
    high_ns = one.period_ns // 2 if one.high_ns is None else one.high_ns
    share = {
        Waveform.SINE: (1 + math.sin(2 * math.pi * part)) / 2,
        Waveform.TRIANGLE: 2 * part if part < 0.5 else 2 - 2 * part,
        Waveform.SAWTOOTH: part,
        Waveform.SQUARE: float((at_ns + one.phase_ns) % one.period_ns < high_ns),
    }[one.shape]
    return one.low_v + (one.high_v - one.low_v) * share


@QUICK
@given(
    shape=st.sampled_from(list(Waveform)), low=VOLTS, high=VOLTS, period=st.integers(1, 10**10),
    phase=st.integers(0, 10**10), start=st.integers(0, 10**12),
    after=st.integers(0, 10**12), share=st.none() | st.integers(0, 10),
)  # fmt: skip
def test_an_oscillation_is_what_it_is_called(
    make_fake_chip: Callable[[], Any], shape: Waveform, low: float, high: float, period: int, phase: int, start: int,
    after: int, share: int | None,
) -> None:  # fmt: skip
    chip = make_fake_chip()
    high_ns = None if share is None else period * share // 10
    one = Oscillation(shape=shape, low_v=low, high_v=high, period_ns=period, phase_ns=phase % period, high_ns=high_ns)
    chip.now_ns = start
    chip.pins["PB1"].set_volts(one)
    uv = chip.pins.fabric.channel_uv(9, start + after)
    rounding = 2.5 + abs(high - low) / 100  # of the result to 1, of phase and sine to 2^-28
    assert abs(uv - 1e6 * expected(one, after)) < rounding


@QUICK
@given(
    volts=st.lists(VOLTS, min_size=1, max_size=6), interval=st.integers(1, 10**6), after=st.integers(0, 10**7),
    repeated=st.booleans(), held=st.booleans(),
)  # fmt: skip
def test_samples_lie_on_lines_or_are_held(
    make_fake_chip: Callable[[], Any], volts: list[float], interval: int, after: int, repeated: bool, held: bool
) -> None:
    chip = make_fake_chip()
    chip.pins["PA7"].set_volts(Samples(volts=tuple(volts), interval_ns=interval, is_repeated=repeated, is_held=held))
    index, within = divmod(after, interval)
    if repeated:
        here, following = volts[index % len(volts)], volts[(index + 1) % len(volts)]
    else:
        here, following = (volts[min(n, len(volts) - 1)] for n in (index, index + 1))
    wanted = here if held else here + (following - here) * within / interval
    assert abs(chip.pins.fabric.channel_uv(7, after) - 1e6 * wanted) <= 1


def test_every_pin_has_its_channel_and_a_constant_has_a_level(fake_chip: Any) -> None:
    pins = [*(f"PA{n}" for n in range(8)), "PB0", "PB1"]
    for channel, name in enumerate(pins):
        fake_chip.pins[name].set_volts(0.3 * channel)
        assert fake_chip.pins.fabric.channel_uv(channel, 0) == 300_000 * channel
        assert fake_chip.pins[name].volts == pytest.approx(0.3 * channel)
        assert fake_chip.pins[name].level is (0.3 * channel >= 1.65)
    fake_chip.pins["PA8"].set_volts(2.0)
    assert (fake_chip.pins["PA8"].level, fake_chip.pins["PA8"].volts) == (True, None)
    fake_chip.pins["PA0"].set_volts(None)
    assert (fake_chip.pins["PA0"].is_floating, fake_chip.pins["PA0"].volts) == (True, 0.0)
    assert fake_chip.warnings == {}


@pytest.mark.parametrize(
    "volts",
    [
        5.0,
        Oscillation(shape=Waveform.SINE, low_v=3.7, high_v=-1, period_ns=9),
        Samples(volts=(0.0, 3.7, 1.0), interval_ns=1),
    ],
)
def test_more_volts_than_the_pin_bears_are_warned_of(fake_chip: Any, volts: Any) -> None:
    fake_chip.pins["PA0"].set_volts(volts)
    assert list(fake_chip.warnings) == ["PA0:volts"]


SINE = Oscillation(shape=Waveform.SINE, low_v=0, high_v=1, period_ns=10)


@pytest.mark.parametrize("volts", [math.nan, math.inf, 1000, -1000.0])
def test_volts_that_are_none_are_refused(fake_chip: Any, volts: float) -> None:
    with pytest.raises(ValueError, match="V on a pin"):
        fake_chip.pins["PA0"].set_volts(volts)


@pytest.mark.parametrize("name", ["PA8", "PC13", "PB2"])
def test_a_signal_on_a_pin_without_an_adc_is_refused(fake_chip: Any, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} leads to no ADC"):
        fake_chip.pins[name].set_volts(SINE)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Oscillation(shape=Waveform.SINE, low_v=0, high_v=1, period_ns=0),
        lambda: Oscillation(shape=Waveform.SINE, low_v=0, high_v=1, period_ns=10, phase_ns=10),
        lambda: Oscillation(shape=Waveform.SQUARE, low_v=0, high_v=1, period_ns=10, high_ns=11),
        lambda: Oscillation(shape=Waveform.SINE, low_v=0, high_v=math.nan, period_ns=10),
        lambda: Samples(volts=(), interval_ns=1),
        lambda: Samples(volts=(1.0,), interval_ns=0),
        lambda: Samples(volts=(1.0, math.inf), interval_ns=1),
    ],
)
def test_what_is_no_signal_is_refused(make: Callable[[], Any]) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        make()
