"""The silicon kit: what the model says of itself, beside a chip that says otherwise; logs that are none."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.__main__ import run
from bluepill_sim.analysis.silicon.comparison import ComparedNumber, Model, NumberVerdict, ask_model, compare
from bluepill_sim.analysis.silicon.log import HEAD, SiliconLog, SiliconLogError, read_log
from bluepill_sim.peripherals.rcc import Rcc


@pytest.fixture(scope="module")
def model() -> Model:
    return ask_model()


def printed(log: SiliconLog) -> bytes:
    """Return a log as the kit prints it."""
    lines = [HEAD, *(f"reg {address:08x} {word:08x}" for address, word in log.registers.items())]
    lines += [f"{kind} {name} {value:08x}" for (kind, name), value in log.numbers.items()]
    checksum = 0
    for character in "".join(f"{line}\n" for line in lines):
        checksum = ((checksum << 1 | checksum >> 31) + ord(character)) & 0xFFFF_FFFF
    return "\n".join([*lines, f"end {len(lines):08x} {checksum:08x}", ""]).encode()


def differing(log: SiliconLog, model: Model) -> list[ComparedNumber]:
    return [row for row in compare(log, model) if row.verdict is not NumberVerdict.SAME]


def test_the_model_says_of_itself_what_its_tables_say(model: Model) -> None:
    log = model.log
    assert len(log.registers) == 379
    reset = {register.offset: register.reset for register in Rcc.REGISTERS}
    assert log.registers[0x4002_1000] == 0x83
    assert all(log.registers[0x4002_1000 + 4 * n] == reset[4 * n] for n in (1, 2, 3, 4, 6, 7))
    numbers = log.numbers
    # 64 of one cycle; a multiplication is one more where it accumulates; ten periods of 10 000 cycles.
    assert [numbers["sram", name] for name in ("k_nop", "k_mul", "k_mla", "k_udiv_long")] == [64, 64, 128, 448]
    assert abs(numbers["tim", "tim2_10_periods"] - 100_000) < 20
    # 1.5 + 12.5 and 239.5 + 12.5 cycles of the ADC, six of the core each, and the polls around them.
    assert 84 <= numbers["tim", "adc_1_5"] <= 110
    assert 1512 <= numbers["tim", "adc_239_5"] <= 1530
    # 400 periods of 40 kHz at 72 MHz, and at 8 MHz.
    assert abs(numbers["tim", "lsi_400_periods"] - 720_000) < 50
    assert abs(numbers["tim", "lsi_400_periods_hsi"] - 80_000) < 50
    # A character is ten bits of 625 cycles.
    assert 6250 <= numbers["tim", "usart_character"] <= 6300
    assert numbers["flag", "crc_of_12345678"] == 0xDF8A8A2B
    assert differing(read_log(printed(log), "x"), model) == []


def test_a_measurement_that_was_published_is_beside_the_model(model: Model) -> None:
    # A loop of SUBS and BHI in SRAM takes 4 cycles on a real STM32F103 (docs/silicon.md names the source), and 3 here.
    assert model.log.numbers["sram", "k_loop_subs_bhi"] == 300


@pytest.mark.parametrize(
    ("address", "bits", "verdict"),
    [
        (0x4002_1000, 0x0000_0008, NumberVerdict.ALLOWED),
        (0x4002_1000, 0x0000_8000, NumberVerdict.ALLOWED),
        (0x4002_1000, 0x0000_0004, NumberVerdict.DIFFERS),
        (0x4002_1000, 0x0001_0000, NumberVerdict.DIFFERS),
        (0x4001_0808, 0x0000_8001, NumberVerdict.ALLOWED),
        (0x4001_0800, 0x0000_0001, NumberVerdict.DIFFERS),
        (0xE004_2000, 0x2003_6410, NumberVerdict.ALLOWED),
        (0x1FFF_F7E0, 0x0000_0040, NumberVerdict.DIFFERS),
    ],
)
def test_a_register_may_differ_where_there_is_a_reason(
    model: Model, address: int, bits: int, verdict: NumberVerdict
) -> None:
    other = SiliconLog({**model.log.registers, address: model.log.registers[address] ^ bits}, model.log.numbers)
    found = differing(other, model)
    assert [row.verdict for row in found] == [verdict]
    assert bool(found[0].reason) is (verdict is NumberVerdict.ALLOWED)


@pytest.mark.parametrize(
    ("kind", "name", "value", "verdict"),
    [
        ("tim", "flash_erase_page", 1_440_000 - 1, NumberVerdict.DIFFERS),
        ("tim", "flash_erase_page", 2_880_000, NumberVerdict.ALLOWED),
        ("tim", "flash_program", 5_041, NumberVerdict.DIFFERS),
        ("tim", "lsi_400_periods", 480_000, NumberVerdict.ALLOWED),
        ("tim", "lsi_400_periods", 960_001, NumberVerdict.DIFFERS),
        ("sram", "k_nop", 65, NumberVerdict.DIFFERS),
        ("flag", "usart_sr_idle", 0x40, NumberVerdict.DIFFERS),
    ],
)
def test_a_number_may_differ_as_far_as_its_range_goes(
    model: Model, kind: str, name: str, value: int, verdict: NumberVerdict
) -> None:
    other = SiliconLog(model.log.registers, {**model.log.numbers, (kind, name): value})
    assert [(row.name, row.verdict) for row in differing(other, model)] == [(name, verdict)]


@pytest.mark.parametrize(("apart", "verdict"), [(0, NumberVerdict.ALLOWED), (1, NumberVerdict.DIFFERS)])
def test_a_time_may_differ_by_a_fiftieth(model: Model, apart: int, verdict: NumberVerdict) -> None:
    ours = model.log.numbers["tim", "tim2_10_periods"]
    for value in (ours + ours // 50 + apart, ours - ours // 50 - apart):
        other = SiliconLog(model.log.registers, {**model.log.numbers, ("tim", "tim2_10_periods"): value})
        assert [row.verdict for row in differing(other, model)] == [verdict]


def test_a_number_that_only_one_of_them_has_is_reported(model: Model) -> None:
    numbers = dict(model.log.numbers)
    del numbers["irq", "exit"]
    numbers["irq", "later"] = 5
    found = differing(SiliconLog(model.log.registers, numbers), model)
    assert [(row.name, row.verdict) for row in found] == [
        ("exit", NumberVerdict.MISSING),
        ("later", NumberVerdict.MISSING),
    ]


SHORT = printed(SiliconLog({0x4002_1000: 0x83}, {("sram", "k_nop"): 64, ("tim", "adc_1_5"): 100}))


def test_noise_before_the_first_line_and_line_ends_of_a_terminal_are_no_matter() -> None:
    noisy = b"\xff\x00garbage\r\n" + SHORT.replace(b"\n", b"\r\n")
    assert read_log(noisy, "x") == read_log(SHORT, "x")


@given(st.data())
@settings(max_examples=200)
def test_a_log_that_is_cut_or_damaged_anywhere_is_refused(data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(SHORT) - 2))
    with pytest.raises(SiliconLogError) as caught:
        read_log(SHORT[:at], "x.log")
    assert caught.value.exit_code == 2
    byte = data.draw(st.integers(0, 255).filter(lambda byte: byte != SHORT[at]))
    damaged = SHORT[:at] + bytes((byte,)) + SHORT[at + 1 :]
    with pytest.raises(SiliconLogError, match=r"^x\.log[^\n]*(\nhint: [^\n]*)?$"):
        read_log(damaged, "x.log")


@given(st.binary(max_size=400))
def test_any_bytes_are_a_log_or_are_refused_in_one_line(data: bytes) -> None:
    with pytest.raises(SiliconLogError) as caught:
        read_log(HEAD.encode() + b"\n" + data, "x.log")
    assert "\n" not in str(caught.value)


def test_the_command_line_tells_what_differs_and_ends_with_1(
    tmp_path: Path, model: Model, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bluepill_sim.cli.comparisons.compare_silicon.ask_model", lambda: model)
    path = tmp_path / "board.log"
    path.write_bytes(printed(model.log))
    assert run(["compare-silicon", str(path)]) == 0
    same = capfd.readouterr().out
    assert same.splitlines()[0].startswith("reg     registers before anything was changed: ")
    assert "differs" not in same
    numbers = {**model.log.numbers, ("sram", "k_loop_subs_bhi"): 400}
    path.write_bytes(printed(SiliconLog(model.log.registers, numbers)))
    assert run(["compare-silicon", str(path)]) == 1
    assert "sram    k_loop_subs_bhi  chip 400  model 300 +33.3 %  differs\n" in capfd.readouterr().out
    path.write_bytes(SHORT[:-20])
    assert run(["compare-silicon", str(path)]) == 2
    assert "board.log" in capfd.readouterr().err
    assert run(["compare-silicon", str(tmp_path / "none.log")]) == 2
