"""The board's face: warnings, faults, snapshots, reset, registers."""

import pickle
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

import bluepill_sim
from bluepill_sim.board import BluePill
from bluepill_sim.errors import UnmodelledError
from bluepill_sim.fabric.pins import PinDrive
from simbase.timing import Reason
from tests.tools.examples import EXAMPLES

FOLDER = EXAMPLES
SYSTICK_CTRL, SYSTICK_LOAD, SYSTICK_VAL = 0xE000E010, 0xE000E014, 0xE000E018


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


BLINK = (
    store(0x40021018, 1 << 4) + store(0x40011004, 0x44244444)
    + store(SYSTICK_LOAD, 799) + store(SYSTICK_VAL, 0) + store(SYSTICK_CTRL, 7)
    + "loop: wfi\nadds r4, #1\nb loop\n"
    "tick: mov32 r1, #0x4001100C\nldr r2, [r1, #0]\nmov32 r3, #0x2000\n.half 0x405A\nstr r2, [r1, #0]\nlog #1\nbx lr"
)  # fmt: skip


@pytest.mark.parametrize("name", ["motors", "sensors", "encoders", "dodge"])
def test_the_example_programs_boot_and_idle_without_a_warning(name: str) -> None:
    board = BluePill(FOLDER / f"{name}.elf")
    text = bytearray()
    board.usart1.subscribe(lambda rows: text.extend(word for word, _ in rows))
    for signal in (
        "PA4",
        "PA5",
        "PA6",
        "PA7",
        "PB0",
        "PB1",
        "PB10",
        "PB11",
        "PB4",
        "PB3",
        "PB15",
        "PC13",
        "PC14",
        "PC15",
    ):
        board.pin(signal).drive(False)
    assert board.advance_to(200_000_000).reason is Reason.DEADLINE
    assert board.warnings == []
    assert board.fault is None
    assert board.hclk_hz == 72_000_000
    assert board.is_asleep
    assert board.pin("PB12").output is PinDrive.HIGH
    assert text.endswith(b"\n")
    assert board.activity.last_usart_ns > 0


def test_a_watched_pin_ends_the_slice_and_an_unwatched_one_does_not(boot) -> None:
    machine = boot(BLINK, {15: "tick"})
    assert machine.board.advance_to(150_000).reason is Reason.DEADLINE
    machine.board.subscribe_pins(["PC13"], lambda _rows: None, ends_slice=["PC13"])
    reached = machine.board.advance_to(1_000_000)
    assert reached.reason is Reason.EDGE
    assert reached.now < 250_000
    assert machine.edges[-1][2] <= reached.now


def test_a_snapshot_continues_alike_here_and_on_another_board(boot) -> None:
    machine = boot(BLINK, {15: "tick"}).run(333)
    snapshot = machine.board.snapshot()
    machine.run(1000)
    rest, log, cycle = machine.edges[:], machine.log, machine.board.cycle
    for board in (machine, boot(BLINK, {15: "tick"})):
        first_edges = len([edge for edge in rest if edge[2] <= 333_000])
        board.edges[:] = rest[:first_edges]
        board.board.restore(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - our own bytes
        board.run(1000)
        assert (board.edges, board.log, board.board.cycle) == (rest, log, cycle)


def test_a_snapshot_is_not_an_alias_of_the_live_board(boot) -> None:
    machine = boot(BLINK, {15: "tick"}).run(333)
    snapshot = machine.board.snapshot()
    before = pickle.dumps(snapshot)
    machine.run(1000)
    assert pickle.dumps(snapshot) == before


def test_a_snapshot_keeps_programs_in_sram_and_in_flash(boot) -> None:
    """Code in SRAM differs between the snapshot and now: what was translated must be forgotten."""
    machine = boot(
        store(0x2000_0800, 0x47702001) + "mov32 r3, #0x20000801\nloop: blx r3\nlog r0\ncmp r0, #1\nbne stop\n"
        + "sev\nwfe\nwfe\n" + store(0x2000_0800, 0x47702002) + "b loop"
    ).run(50)  # fmt: skip
    snapshot = machine.board.snapshot()
    for _ in range(2):
        machine.board.chip.signal("event")
        assert machine.run(50).log == [1, 2]
        machine.board.chip.memory.load_flash(0x9000, b"\0\0")
        machine.board.restore(snapshot)
        assert machine.log == [1]
    assert machine.board.read_memory(0x0800_9000, 2) == b"\xff\xff"


def test_a_snapshot_keeps_an_exclusive_reservation(boot) -> None:
    """Taken between LDREX and STREX, at each boundary of the program: the store succeeds on the other board too."""
    source = "mov32 r1, #0x20000800\nldrex r2, [r1]\nb on\non: strex r0, r2, [r1]\nlog r0\nb stop"
    machine = boot(source)
    for _ in range(6):
        machine.board.advance_to(machine.board.now_ns + 1)
        other = boot(source)
        other.board.restore(machine.board.snapshot())
        assert other.run(20).log == [0]


def test_something_else_is_no_snapshot(boot) -> None:
    with pytest.raises(TypeError, match="not a snapshot of BluePill"):
        boot("nop").board.restore(5)


@pytest.mark.parametrize("access", ["str", "ldr"])
def test_strict_mode_raises_at_the_first_warning(boot, access: str) -> None:
    image = boot(f"mov32 r1, #0x40013400\n{access} r2, [r1, #0]").image
    board = BluePill(image, strict=True)
    with pytest.raises(UnmodelledError, match="TIM8 is not modelled") as error:
        board.advance_to(1_000_000)
    assert error.value.exit_code == 1


def test_warnings_are_reported_once_as_they_come(boot) -> None:
    machine = boot("movs r4, #3\nloop: " + store(0x40013400, 1) + "subs r4, #1\nbne loop")
    reported = []
    end = machine.board.subscribe_warnings(reported.append)
    machine.run(100)
    end()
    assert reported == machine.board.warnings
    assert len(reported) == 1


def test_the_reset_button_starts_again_while_time_goes_on(boot) -> None:
    machine = boot(BLINK, {15: "tick"}).run(500)
    at = machine.board.now_ns
    machine.board.reset()
    assert machine.board.now_ns == at
    assert machine.board.pin("PC13").output is PinDrive.NONE
    assert machine.board.pc == machine.label("start")
    assert machine.run(500).log == [1] * 4


def test_the_face_tells_where_the_program_is(boot) -> None:
    machine = boot("here: b here").run(10)
    assert machine.board.where() == f"here+0x0 ({machine.label('here'):#010x})"
    assert machine.board.register("sp") == 0x2000_5000
    assert machine.board.read_memory(0x3000_0000, 4) is None
    assert machine.board.next_deadline() is None
    with pytest.raises(KeyError):
        machine.board.pin("PZ1")


def test_inside_a_handler_the_face_tells_of_which_exception(boot) -> None:
    machine = boot(f"{BLINK}\nstuck: b stuck", {15: "stuck"}).run(500)
    assert machine.board.where() == f"stuck+0x0 ({machine.label('stuck'):#010x}), handling SysTick"


def test_the_next_deadline_is_the_earliest_of_tick_and_peripherals(boot) -> None:
    machine = boot(BLINK, {15: "tick"}).run(50)
    due = machine.board.next_deadline()
    assert 100_000 < due < 200_000
    machine.board.advance_to(due - 1)
    assert machine.log == []
    machine.board.advance_to(due)
    assert machine.run(10).log == [1]


def test_an_exception_in_a_listener_comes_out_of_advance_to(boot) -> None:
    machine = boot(BLINK, {15: "tick"})

    def fail(rows: bytes) -> None:
        raise KeyboardInterrupt

    subscription = machine.board.subscribe_pins(["PC13"], fail)
    with pytest.raises(KeyboardInterrupt):
        machine.board.advance_to(1_000_000)
    subscription.close()
    assert machine.board.advance_to(2_000_000).reason is Reason.DEADLINE


def test_ctrl_c_while_blocks_run_comes_out_and_the_run_can_go_on(boot, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal's handler runs inside a callback from C, which would swallow the exception."""
    whole = boot(BLINK, {15: "tick"}).run(2000)
    machine = boot(BLINK, {15: "tick"}).run(333)
    engine = machine.board.chip.engine
    blocks = engine._blocks
    measure = blocks._measure

    def interrupted(address: int, size: int) -> object:
        raise KeyboardInterrupt

    engine.forget_costs()
    monkeypatch.setattr(blocks, "_measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        machine.board.advance_to(2_000_000)
    monkeypatch.setattr(blocks, "_measure", measure)
    machine.board.advance_to(2_000_000)
    assert (machine.edges, machine.log) == (whole.edges, whole.log)


def test_the_other_serial_ports_are_there(boot) -> None:
    board = boot("nop").board
    board.usart2.receive(b"x")
    board.usart3.receive(b"x")
    assert len(board.warnings) == 2


def test_the_package_names_its_public_face() -> None:
    assert set(bluepill_sim.__all__) >= {"BluePill", "BluePillError", "FaultReport", "Image", "PinDrive", "load_image"}
    assert bluepill_sim.BluePill is BluePill


C_PROGRAM = """
#include <stdint.h>
#include <string.h>
struct big { uint32_t words[8]; uint64_t wide; } a, b;
volatile uint32_t results[8]; volatile uint32_t done;
static int choose(unsigned n) { switch (n) { case 0: return 5; case 1: return 7; case 2: return 11; case 3: return 13;
  case 4: return 17; case 5: return 19; default: return 0; } }
static uint32_t fib(uint32_t n) { return n < 2 ? n : fib(n - 1) + fib(n - 2); }
int main(void) {
  for (unsigned n = 0; n < 8; n++) a.words[n] = n * n;
  a.wide = 0x123456789abcdef0ull; b = a;
  int sum = 0; for (unsigned n = 0; n < 7; n++) sum += choose(n);
  volatile int32_t minus = -100, seven = 7;
  results[0] = (uint32_t)sum; results[1] = fib(10); results[2] = (uint32_t)(b.wide / 1000u);
  results[3] = (uint32_t)(minus / seven); results[4] = (uint32_t)(minus % seven); results[5] = b.words[7];
  results[6] = (uint32_t)((uint64_t)fib(20) * 1000003u >> 7); results[7] = (uint32_t)memcmp(&a, &b, sizeof a);
  done = 1; for (;;) {} }
void reset(void) { main(); }
__attribute__((section(".v"), used)) void *const vectors[2] = {(void *)0x20005000, (void *)reset};
"""


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed")
@pytest.mark.parametrize("level", ["-O0", "-O2", "-Os"])
def test_what_the_compiler_makes_computes_right(level: str, tmp_path: Path) -> None:
    source, elf = tmp_path / "a.c", tmp_path / "a.elf"
    source.write_text(C_PROGRAM)
    (tmp_path / "a.ld").write_text(
        "MEMORY { F (rx): ORIGIN = 0x08000000, LENGTH = 64K\n R (rwx): ORIGIN = 0x20000000, LENGTH = 20K }\n"
        "SECTIONS { .text : { KEEP(*(.v)) *(.text*) *(.rodata*) } > F\n .bss : { *(.bss*) *(COMMON) } > R }"
    )
    flags = ["-mcpu=cortex-m3", "-mthumb", "-nostartfiles", "-T", str(tmp_path / "a.ld"), level, "--specs=nosys.specs"]
    subprocess.run(["arm-none-eabi-gcc", *flags, "-o", elf, source], check=True, capture_output=True)
    board = BluePill(elf)
    board.advance_to(300_000_000)
    assert board.fault is None
    results = board.image.symbols.address_of("results")
    values = struct.unpack("<8I", board.read_memory(results, 32))
    wide = 0x123456789ABCDEF0 // 1000 & 0xFFFFFFFF
    assert values == (72, 55, wide, 0xFFFFFFF2, 0xFFFFFFFE, 49, 6765 * 1000003 >> 7, 0)


def test_sram_takes_other_content_at_power_on_and_only_then() -> None:
    board = BluePill(FOLDER / "dodge.elf")
    content = bytes(range(256)) * 80
    board.power_up_with(content)
    assert board.chip.memory.sram.raw == content
    with pytest.raises(ValueError, match="20480 bytes, before the board runs: 3 at cycle 0"):
        board.power_up_with(b"abc")
    board.run_for("1 ms")
    with pytest.raises(ValueError, match="before the board runs"):
        board.power_up_with(content)
