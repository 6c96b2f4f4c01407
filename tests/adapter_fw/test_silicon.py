"""The core on other machines: the same run gives the same hash under sanitizers, on a Cortex-M3 and on an Xtensa."""

import shutil
import subprocess
from pathlib import Path

import pytest

from bluepill_sim import BluePill
from tests.adapter_fw.budgets import ADAPTER_BYTES, documented, is_as_documented
from tests.adapter_fw.builds import built

#: Virtual seconds on each machine, and what the host's program is asked for.
SPAN_S, SEED = 20, 1
#: The core has no variables of its own.
RAM_BYTES = 64


def numbers(text: str) -> dict[str, int]:
    rows = [line.split() for line in text.splitlines()]
    assert rows[-1] == ["ok"], text
    return {name: int(value) for name, value in (row for row in rows if len(row) == 2)}


def run_host(program: Path, span_s: int, seed: int) -> dict[str, int]:
    done = subprocess.run([program, str(span_s), str(seed)], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return numbers(done.stdout)


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("host", tmp_path_factory.mktemp("host"))[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 9))
def test_ten_minutes_of_accidents_under_sanitizers_show_no_fault(host: Path, seed: int) -> None:
    result = run_host(host, 600, seed)
    assert result["sessions"] > 10
    assert result["losses"] > 5


@pytest.mark.slow
def test_the_cortex_m3_of_our_emulator_gives_the_same_run(host: Path, tmp_path: Path) -> None:
    program, size = built("cortex-m", tmp_path)
    chip, text = BluePill(program), bytearray()
    chip.usart1.subscribe(lambda rows: text.extend(word for word, _ in rows))
    while b"ok\n" not in text and b"failed" not in text and chip.now_ns < 10 * 10**9:
        chip.advance_to(chip.now_ns + 10**8)
        assert chip.fault is None, chip.fault
    result = numbers(text.decode())
    assert {name: result[name] for name in run_host(host, SPAN_S, SEED)} == run_host(host, SPAN_S, SEED)
    assert is_as_documented(result["longest_call_cycles"], documented("longest call").cortex_m)
    assert is_as_documented(result["adapter_bytes"], documented(ADAPTER_BYTES).cortex_m)
    assert is_as_documented(size["flash"], documented("core, flash").cortex_m)
    assert size["ram"] <= RAM_BYTES


@pytest.mark.slow
def test_an_xtensa_in_qemu_gives_the_same_run(host: Path, tmp_path: Path) -> None:
    program, size = built("xtensa", tmp_path)
    emulator = shutil.which("qemu-system-xtensa")
    if emulator is None:
        pytest.skip("qemu-system-xtensa is not installed: apt-get install qemu-system-misc")
    done = subprocess.run(
        [emulator, "-M", "sim", "-cpu", "lx106", "-semihosting", "-nographic", "-monitor", "none", "-serial", "none",
         "-kernel", program],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    result = numbers(done.stdout)
    assert {name: result[name] for name in run_host(host, SPAN_S, SEED)} == run_host(host, SPAN_S, SEED)
    assert is_as_documented(result["adapter_bytes"], documented(ADAPTER_BYTES).xtensa)
    assert is_as_documented(size["flash"], documented("core, flash").xtensa)
    assert size["ram"] <= RAM_BYTES


@pytest.mark.slow
def test_the_core_links_for_the_esp32s_processor_with_its_register_windows(tmp_path: Path) -> None:
    program, size = built("esp32-windows", tmp_path)
    assert program.read_bytes()[:4] == b"\x7fELF"
    assert is_as_documented(size["flash"], documented("core, flash").esp32)
    assert size["ram"] <= RAM_BYTES


@pytest.mark.soak
def test_an_esp32_in_labwired_gives_the_same_run(host: Path, tmp_path: Path) -> None:
    labwired = pytest.importorskip("labwired", reason="make mutation-tools")
    program, _ = built("esp32-core", tmp_path)
    text = ""
    with labwired.Sim(program, chip="esp32") as chip:
        for _ in range(60):
            chip.run_for("20ms")
            text += chip.read_uart()
            if text.endswith("ok\n"):
                break
    result = numbers(text)
    assert {name: result[name] for name in run_host(host, SPAN_S, SEED)} == run_host(host, SPAN_S, SEED)
