"""IWDG and WWDG: time-outs from the manual's tables, keys, the window, the early warning."""

from typing import Any

import pytest

from bluepill_sim.peripherals.iwdg import DIVIDERS, FEED, START, UNLOCK, UPDATE_CYCLES
from bluepill_sim.peripherals.rcc import ResetCause

MS = 1_000_000
LSI_NS = 25_000
UPDATE_NS = UPDATE_CYCLES * LSI_NS


def start_iwdg(chip: Any, pr: int, rlr: int) -> None:
    """The order of the manual: start, unlock, set, wait, feed."""
    for register, value in (("KR", START), ("KR", UNLOCK), ("PR", pr), ("RLR", rlr)):
        chip.write(f"IWDG.{register}", value)
    chip.advance(chip.now_ns + UPDATE_NS)
    assert chip.read("IWDG.SR") == 0
    chip.write("IWDG.KR", FEED)


@pytest.mark.parametrize("pr", range(8))
@pytest.mark.parametrize("rlr", [0, 1, 1000, 0xFFF])
def test_the_time_out_is_that_of_the_manuals_table(fake_chip: Any, pr: int, rlr: int) -> None:
    """RM0008 table 96: 0.1 ms to 409.6 ms at a divider of 4, doubled by each step, at 40 kHz."""
    start_iwdg(fake_chip, pr, rlr)
    due = fake_chip.now_ns + (rlr + 1) * DIVIDERS[pr] * LSI_NS
    fake_chip.advance(due - 1)
    assert fake_chip.expired == []
    fake_chip.advance(due)
    assert fake_chip.expired == [("IWDG", due)]


def test_feeding_puts_it_off_and_nothing_stops_it(fake_chip: Any) -> None:
    start_iwdg(fake_chip, 0, 99)  # 10 ms
    for _ in range(5):
        fake_chip.advance(fake_chip.now_ns + 10 * MS - 1)
        fake_chip.write("IWDG.KR", FEED)
    assert fake_chip.expired == []
    for key in (START, UNLOCK, 0):
        fake_chip.write("IWDG.KR", key)
    fake_chip.advance(fake_chip.now_ns + 10 * MS)
    assert len(fake_chip.expired) == 1


def test_before_its_start_nothing_counts(fake_chip: Any) -> None:
    fake_chip.write("IWDG.KR", FEED)
    assert fake_chip.parts.next_deadline() is None
    assert not fake_chip.parts.has_running_watchdog
    fake_chip.write("IWDG.KR", START)
    assert fake_chip.parts.has_running_watchdog
    assert fake_chip.parts.by_name["IWDG"].due_ns == 0x1000 * 4 * LSI_NS


def test_settings_are_locked_without_their_key(fake_chip: Any) -> None:
    fake_chip.write("IWDG.PR", 3)
    fake_chip.write("IWDG.KR", UNLOCK)
    fake_chip.write("IWDG.RLR", 5)
    fake_chip.write("IWDG.KR", FEED)  # locks again
    fake_chip.write("IWDG.RLR", 7)
    assert (fake_chip.read("IWDG.PR"), fake_chip.read("IWDG.RLR")) == (0, 5)
    assert set(fake_chip.warnings) == {"IWDG:1:locked", "IWDG:2:locked"}


def test_an_update_takes_five_cycles_of_lsi_and_refuses_another(fake_chip: Any) -> None:
    fake_chip.write("IWDG.KR", UNLOCK)
    fake_chip.write("IWDG.PR", 1)
    fake_chip.write("IWDG.PR", 2)
    assert (fake_chip.read("IWDG.PR"), fake_chip.read("IWDG.SR")) == (1, 1)
    fake_chip.write("IWDG.RLR", 9)
    fake_chip.now_ns = UPDATE_NS - 1
    assert fake_chip.read("IWDG.SR") == 3
    fake_chip.now_ns = UPDATE_NS
    assert fake_chip.read("IWDG.SR") == 0


def test_a_wrong_key_is_warned_of(fake_chip: Any) -> None:
    fake_chip.write("IWDG.KR", 0x1234)
    assert "IWDG:key" in fake_chip.warnings


@pytest.mark.parametrize("prescaler", range(4))
@pytest.mark.parametrize("count", [0x40, 0x41, 0x7F])
def test_the_window_watchdog_resets_as_its_counter_falls_below_0x40(fake_chip: Any, prescaler: int, count: int) -> None:
    """RM0008 20.4: T = 4096 * 2^WDGTB * (T[5:0] + 1) / PCLK1, here 8 MHz: 512 us a count."""
    fake_chip.write("WWDG.CFR", prescaler << 7 | 0x7F)
    fake_chip.write("WWDG.CR", 0x80 | count)
    due = 512_000 * (1 << prescaler) * (count - 0x3F)
    fake_chip.advance(due - 1)
    assert fake_chip.expired == []
    assert fake_chip.read("WWDG.CR") == 0x80 | 0x40
    fake_chip.advance(due)
    assert fake_chip.expired == [("WWDG", due)]


def test_feeding_inside_the_window_is_good_and_before_it_is_not(fake_chip: Any) -> None:
    fake_chip.write("WWDG.CFR", 0x50)
    fake_chip.write("WWDG.CR", 0xFF)
    window_opens = 512_000 * (0x7F - 0x50)
    fake_chip.advance(window_opens)
    fake_chip.write("WWDG.CR", 0xFF)
    assert fake_chip.expired == []
    fake_chip.advance(2 * window_opens - 1)
    fake_chip.write("WWDG.CR", 0xFF)
    assert fake_chip.expired == [("WWDG", 2 * window_opens - 1)]


def test_activation_without_t6_resets_at_once(fake_chip: Any) -> None:
    fake_chip.write("WWDG.CR", 0x80)
    assert fake_chip.expired == [("WWDG", 0)]


def test_the_early_wake_up_comes_one_count_before_the_reset(fake_chip: Any) -> None:
    fake_chip.write("WWDG.CFR", 1 << 9 | 0x7F)
    fake_chip.write("WWDG.CR", 0x80 | 0x42)
    fake_chip.advance(2 * 512_000 - 1)
    assert not fake_chip.irqs[0]
    fake_chip.advance(2 * 512_000)
    assert fake_chip.irqs[0]
    fake_chip.write("WWDG.SR", 0)
    assert not fake_chip.irqs[0]
    fake_chip.write("WWDG.CFR", 0x7F)
    assert fake_chip.read("WWDG.CFR") & 1 << 9  # only a reset takes it back
    fake_chip.write("WWDG.CR", 0x7F)
    assert fake_chip.parts.has_running_watchdog  # and the activation


def test_an_idle_window_watchdog_does_nothing(fake_chip: Any) -> None:
    fake_chip.write("WWDG.CR", 0x45)
    fake_chip.write("WWDG.CFR", 0x41)
    fake_chip.advance(10**9)
    assert (fake_chip.read("WWDG.CR"), fake_chip.expired) == (0x45, [])
    assert fake_chip.parts.next_deadline() is None


def test_the_window_watchdog_follows_pclk1(fake_chip: Any) -> None:
    fake_chip.write("WWDG.CR", 0xFF)
    fake_chip.advance(512_000)
    fake_chip.clocks.pclk1_hz = 4_000_000
    fake_chip.clock_changed()
    assert fake_chip.read("WWDG.CR") == 0xFE
    due = 512_000 + 1_024_000 * (0x7E - 0x3F)
    fake_chip.advance(due - 1)
    assert fake_chip.expired == []
    fake_chip.advance(due)
    assert fake_chip.expired == [("WWDG", due)]


@pytest.mark.parametrize("lsi_hz", [30_000, 47_001, 60_000])
def test_the_time_out_follows_lsi(fake_chip: Any, lsi_hz: int) -> None:
    fake_chip.parts.rcc.set_lsi(lsi_hz)
    fake_chip.write("IWDG.KR", START)
    due = -(-0x1000 * 4 * 10**9 // lsi_hz)
    fake_chip.advance(due - 1)
    assert fake_chip.expired == []
    fake_chip.advance(due)
    assert fake_chip.expired == [("IWDG", due)]


def test_a_count_under_way_goes_on_at_the_new_lsi(fake_chip: Any) -> None:
    fake_chip.write("IWDG.KR", START)
    fake_chip.advance(0x800 * 4 * LSI_NS)
    fake_chip.parts.rcc.set_lsi(60_000)
    due = 0x800 * 4 * LSI_NS - (-0x800 * 4 * 10**9 // 60_000)
    fake_chip.advance(due - 1)
    assert fake_chip.expired == []
    fake_chip.advance(due)
    assert len(fake_chip.expired) == 1


@pytest.mark.parametrize("lsi_hz", [29_999, 60_001])
def test_lsi_has_a_range(fake_chip: Any, lsi_hz: int) -> None:
    with pytest.raises(ValueError, match="30000 to 60000"):
        fake_chip.parts.rcc.set_lsi(lsi_hz)


def test_the_watchdog_keeps_lsi_on_until_a_reset(fake_chip: Any) -> None:
    fake_chip.write("IWDG.KR", START)
    assert fake_chip.read("RCC.CSR") & 3 == 1
    fake_chip.advance(85_000)
    assert fake_chip.read("RCC.CSR") & 3 == 3
    fake_chip.write("RCC.CSR", 0)
    assert fake_chip.read("RCC.CSR") & 3 == 3
    fake_chip.parts.reset(ResetCause.PIN)
    assert fake_chip.read("RCC.CSR") & 3 == 0


def test_the_option_byte_starts_it_with_the_chip(fake_chip: Any) -> None:
    fake_chip.power.starts_watchdog = True
    fake_chip.parts.by_name["IWDG"].reset()
    assert fake_chip.parts.has_running_watchdog
    assert fake_chip.read("RCC.CSR") & 1
    fake_chip.advance(0x1000 * 4 * LSI_NS)
    assert len(fake_chip.expired) == 1


@pytest.mark.parametrize("key", [START, FEED, 0x5554, 0])
def test_each_key_but_the_one_that_unlocks_locks_again(fake_chip: Any, key: int) -> None:
    fake_chip.write("IWDG.KR", UNLOCK)
    fake_chip.write("IWDG.KR", key)
    fake_chip.write("IWDG.PR", 3)
    fake_chip.write("IWDG.RLR", 3)
    assert (fake_chip.read("IWDG.PR"), fake_chip.read("IWDG.RLR"), fake_chip.read("IWDG.SR")) == (0, 0xFFF, 0)
    assert ("IWDG:key" in fake_chip.warnings) is (key not in {START, FEED})
    assert fake_chip.parts.by_name["IWDG"].is_running is (key == START)


@pytest.mark.parametrize(("register", "flag", "other"), [("PR", 1, "RLR"), ("RLR", 2, "PR")])
def test_an_update_has_its_own_flag_and_leaves_the_other_register_open(
    fake_chip: Any, register: str, flag: int, other: str
) -> None:
    fake_chip.write("IWDG.KR", UNLOCK)
    fake_chip.write(f"IWDG.{register}", 5)
    assert fake_chip.read("IWDG.SR") == flag
    fake_chip.advance(1)
    fake_chip.write(f"IWDG.{register}", 6)
    fake_chip.write(f"IWDG.{other}", 6)
    assert (fake_chip.read(f"IWDG.{register}"), fake_chip.read(f"IWDG.{other}")) == (5, 6)
    fake_chip.advance(UPDATE_NS)
    assert fake_chip.read("IWDG.SR") == 3 & ~flag
    fake_chip.advance(UPDATE_NS + 1)
    assert fake_chip.read("IWDG.SR") == 0


def test_a_reset_locks_iwdg_stops_it_and_ends_its_updates(fake_chip: Any) -> None:
    start_iwdg(fake_chip, 1, 9)
    fake_chip.write("IWDG.KR", UNLOCK)
    fake_chip.write("IWDG.PR", 5)
    part = fake_chip.parts.by_name["IWDG"]
    part.reset()
    assert (fake_chip.read("IWDG.SR"), fake_chip.read("IWDG.PR"), part.is_running) == (0, 0, False)
    fake_chip.write("IWDG.PR", 5)
    assert fake_chip.read("IWDG.PR") == 0
    fake_chip.write("IWDG.KR", FEED)
    fake_chip.advance(fake_chip.now_ns + 10_000 * MS)
    assert fake_chip.expired == []
    fake_chip.write("IWDG.KR", UNLOCK)
    fake_chip.write("IWDG.PR", 5)
    assert fake_chip.read("IWDG.PR") == 5
    fake_chip.write("IWDG.KR", START)
    began_ns = fake_chip.now_ns
    fake_chip.advance(began_ns + 4096 * DIVIDERS[5] * LSI_NS)
    assert len(fake_chip.expired) == 1


def test_a_second_start_does_not_feed(fake_chip: Any) -> None:
    fake_chip.write("IWDG.KR", START)
    fake_chip.advance(100 * MS)
    fake_chip.write("IWDG.KR", START)
    fake_chip.advance(4096 * 4 * LSI_NS)
    assert len(fake_chip.expired) == 1


@pytest.mark.parametrize("register", ["CR", "CFR", "SR"])
def test_a_reset_stops_wwdg_and_takes_its_registers_back(fake_chip: Any, register: str) -> None:
    fake_chip.write("WWDG.CFR", 0x3FF)
    fake_chip.write("WWDG.CR", 0xC1)
    fake_chip.advance(8 * 4096 * 125)
    assert (fake_chip.read("WWDG.SR"), fake_chip.irqs[0]) == (1, True)
    fake_chip.parts.by_name["WWDG"].reset()
    assert not fake_chip.irqs[0]
    assert fake_chip.read(f"WWDG.{register}") == {"CR": 0x7F, "CFR": 0x7F, "SR": 0}[register]
    fake_chip.advance(1_000 * MS)
    assert (fake_chip.read("WWDG.CR"), fake_chip.expired) == (0x7F, [])


def test_wdga_and_ewi_stay_until_a_reset_and_ewif_falls_by_0_alone(fake_chip: Any) -> None:
    fake_chip.write("WWDG.CFR", 0x27F)
    fake_chip.write("WWDG.CR", 0xC1)
    fake_chip.write("WWDG.CFR", 0x7F)
    assert fake_chip.read("WWDG.CFR") == 0x27F
    fake_chip.advance(4096 * 125)
    fake_chip.write("WWDG.SR", 1)
    assert (fake_chip.read("WWDG.SR"), fake_chip.irqs[0]) == (1, True)
    fake_chip.write("WWDG.CR", 0x7F)
    assert fake_chip.read("WWDG.CR") == 0xFF
    fake_chip.write("WWDG.SR", 0)
    assert (fake_chip.read("WWDG.SR"), fake_chip.irqs[0]) == (0, False)


def test_a_count_under_way_goes_on_at_the_new_prescaler(fake_chip: Any) -> None:
    for key in (START, UNLOCK):
        fake_chip.write("IWDG.KR", key)
    fake_chip.advance(100 * 4 * LSI_NS)
    fake_chip.write("IWDG.PR", 1)
    assert fake_chip.parts.by_name["IWDG"].due_ns == fake_chip.now_ns + (0x1000 - 100) * 8 * LSI_NS


@pytest.mark.parametrize("enable", [0, 1 << 9])
def test_ewif_interrupts_only_with_ewi(fake_chip: Any, enable: int) -> None:
    fake_chip.write("WWDG.CFR", enable | 0x7F)
    fake_chip.write("WWDG.CR", 0x80 | 0x41)
    fake_chip.advance(512_000)
    assert (fake_chip.read("WWDG.SR"), fake_chip.irqs[0]) == (1, bool(enable))
    fake_chip.write("WWDG.CFR", 1 << 9 | 0x7F)
    assert fake_chip.irqs[0]
