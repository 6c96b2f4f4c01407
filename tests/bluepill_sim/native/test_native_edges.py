"""Edges that the native core keeps in bulk: those that the Python executor tells one by one, and their files."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.analysis.edge_log import EdgeLog
from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.waveforms.vcd_writer import write_vcd
from bluepill_sim.fabric.subscriptions import EDGE, Of
from simbase.errors import FileError
from tests.bluepill_sim.machine import Machine

GPIOB = 0x4001_0C00
#: Port B on, PB0 to PB3 push-pull outputs (PB3 is the debug port's), PB4 an input with a pull that ODR chooses.
SET_UP = f"""
mov32 r0, #0x40021018
mov32 r1, #0x0000000C
str r1, [r0, #0]
mov32 r6, #{GPIOB}
mov32 r1, #0x44482222
str r1, [r6, #0]
mov r5, r6
"""
IDR, ODR, BSRR, BRR = 8, 12, 16, 20
#: One access of a program: a value for a data register, by one of two bases, or a read.
ACCESSES = st.one_of(
    st.tuples(st.sampled_from([ODR, BSRR, BRR]), st.integers(0, 31), st.sampled_from(["r5", "r6"])),
    st.tuples(st.just(IDR), st.just(0), st.sampled_from(["r5", "r6"])),
)


def program(accesses: list[tuple[int, int, str]], rounds: int) -> str:
    lines = [SET_UP, f"movs r4, #{rounds}", "again: nop"]
    for register, value, base in accesses:
        if register == IDR:
            lines.append(f"ldr r3, [{base}, #{register}]")
        else:
            lines += [f"movs r2, #{value}", f"str r2, [{base}, #{register}]"]
    return "\n".join([*lines, "subs r4, #1", "bne again"])


def recording(text: str, core: str, limit_ms: int = 1) -> tuple[Probe, Machine]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        machine = Machine(text, {})
        probe = Probe(machine.board)
        machine.run(1000 * limit_ms)
    assert machine.is_done
    probe.finish()
    return probe, machine


@settings(max_examples=60)
@given(accesses=st.lists(ACCESSES, min_size=1, max_size=14))
def test_every_edge_has_the_time_of_its_store(accesses: list[tuple[int, int, str]]) -> None:
    text = program(accesses, 3)
    native, python = (recording(text, core)[0] for core in ("native", "python"))
    assert native.edges == python.edges
    assert native.initial == python.initial
    assert native.end_ns == python.end_ns


def test_both_cores_write_the_same_file(tmp_path: Path) -> None:
    text = program([(BSRR, 5, "r6"), (IDR, 0, "r5"), (ODR, 16, "r5"), (BRR, 31, "r6")], 200)
    written = []
    for core in ("native", "python"):
        probe, _ = recording(text, core)
        write_vcd(probe, tmp_path / core)
        written.append((tmp_path / core).read_bytes())
    assert written[0] == written[1]
    assert written[0].count(b"\n#") > 400


@pytest.mark.slow
def test_a_full_buffer_loses_nothing() -> None:
    toggle = f"movs r2, #15\nstr r2, [r6, #{BSRR}]\nstr r2, [r6, #{BRR}]\n"
    inner = f"movs r4, #255\nagain: nop\n{toggle * 4}subs r4, #1\nbne again\n"
    text = f"{SET_UP}movs r3, #20\nmore: nop\n{inner}subs r3, #1\nbne more"
    native = recording(text, "native", 40)[0].edges
    counts = {pin: len(edges) for pin, edges in native.items()}
    assert counts == {"PB0": 1 + 20 * 255 * 8, "PB1": 1 + 20 * 255 * 8, "PB2": 20 * 255 * 8}  # PB2: BOOT1, pulled
    assert native["PB0"] == native["PB1"]


def test_another_subscriber_gets_every_edge_beside_a_probe() -> None:
    text = program([(BSRR, 3, "r6"), (BRR, 1, "r6"), (BRR, 2, "r6")], 20)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", "native")
        machine = Machine(text, {})
    heard = bytearray()
    machine.board.subscribe_pins(["PB0"], heard.extend, of=Of.WIRE)
    probe = Probe(machine.board)
    machine.run()
    probe.finish()
    edges = [at_ns for at_ns, _ in probe.edges["PB0"]]
    assert len(edges) == 1 + 2 * 20
    assert edges == [row[0] for row in EDGE.iter_unpack(heard)]


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 100), st.integers(0, 2)), max_size=60))
def test_late_rows_go_where_they_belong(rows: list[tuple[int, int, int]]) -> None:
    log = EdgeLog([], [])
    for at_ns, signal, value in rows:
        log.put(at_ns, signal, value)
    assert list(log.rows()) == sorted(rows, key=lambda row: row[:2])
    assert log.used() == {signal for _, signal, _ in rows}


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_dump_that_cannot_be_written_is_one_line(core: str, tmp_path: Path) -> None:
    probe, _ = recording(program([(BSRR, 1, "r6")], 2), core)
    with pytest.raises(FileError, match=r"cannot write .*: is a directory"):
        write_vcd(probe, tmp_path)


@pytest.mark.skipif(not os.access("/dev/full", os.W_OK), reason="no /dev/full here")
def test_a_full_disk_is_reported_from_c_too() -> None:
    probe, _ = recording(program([(BSRR, 1, "r6"), (BRR, 1, "r6")], 200), "native")
    with pytest.raises(FileError, match="no space left on device"):
        write_vcd(probe, Path("/dev/full"))
