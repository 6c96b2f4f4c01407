"""`p2os mcu pins`: what every pin is, does, and has done."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.analysis.columns import in_columns
from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.waveforms.sigrok_writer import write_sigrok
from bluepill_sim.analysis.waveforms.vcd_writer import write_vcd
from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import parse_changes, print_fault, print_status, run_driven, summary, warn_on_stderr
from bluepill_sim.cli.quantities import Drive, Firmware, JsonOutput, Span
from simbase.timing import NS_PER_S

HELP = """Show each pin's state and activity after running a firmware.

It shows mode, level (for PWM, frequency and duty), driver and edges. --vcd or
--sr also write waveforms, with interrupt lines and USART output.

\b
Examples:
  {program} pins mine.elf                                  pins in use after one second
  {program} pins mine.elf --all                            every pin of the package
  {program} pins mine.elf --for 5s --vcd a.vcd --sr a.sr   for GTKWave and PulseView
  {program} pins mine.elf --drive PA6=1@3.5s               with a level on an input
"""


def pins(
    firmware: Firmware,
    span_ns: Span = NS_PER_S,
    drive: Drive = None,
    vcd: Annotated[Path | None, typer.Option(help="Write a value change dump.", metavar="FILE")] = None,
    sr: Annotated[Path | None, typer.Option(help="Write a sigrok session.", metavar="FILE")] = None,
    every: Annotated[bool, typer.Option("--all", help="Untouched pins too.")] = False,
    json_output: JsonOutput = False,
) -> None:
    """Show the pins."""
    board = BluePill(firmware)
    changes = parse_changes(drive or [], board)
    warn_on_stderr(board)
    probe = Probe(board, with_signals=vcd is not None or sr is not None)
    run_driven(board, span_ns, changes)
    probe.finish()
    if vcd is not None:
        write_vcd(probe, vcd)
    if sr is not None:
        write_sigrok(probe, sr)
    rows = [row for row in pin_rows(board, probe) if every or row["used"]]
    if json_output:
        typer.echo(json.dumps({"at_s": board.now_ns / NS_PER_S, "pins": rows}, sort_keys=True))
    else:
        _print(rows)
    print_status(summary(board))
    if print_fault(board):
        raise typer.Exit(1)


def pin_rows(board: BluePill, probe: Probe) -> list[dict[str, object]]:
    """Return what is shown of each pin that has a leg."""
    rows: list[dict[str, object]] = []
    all_edges = probe.edges
    for pin in board.pins:
        edges = all_edges.get(pin.name, [])
        is_untouched = pin.mode.value == "floating input" and pin.driven is None and not edges
        rows.append(
            {
                "pin": pin.name,
                "mode": pin.mode.value,
                "function": pin.holder or pin.function or "",
                "level": "floating" if pin.is_floating else "high" if pin.level else "low",
                "chip": pin.output.value if pin.wave is None else "wave",
                "outside": {None: "", True: "high", False: "low"}[pin.driven],
                "edges": len(edges),
                "frequency_hz": None if pin.wave is None else pin.wave.frequency_hz,
                "duty": None if pin.wave is None else pin.wave.duty,
                "last_edge_s": edges[-1][0] / NS_PER_S if edges else None,
                "five_volt": pin.is_five_volt_tolerant,
                "used": not is_untouched or pin.holder is not None,
            }
        )
    return rows


def _print(rows: list[dict[str, object]]) -> None:
    headers = ("pin", "mode", "function", "level", "chip drives", "outside", "edges", "last edge", "5 V")
    table = []
    for row in rows:
        last = row["last_edge_s"]
        table.append(
            (
                *(str(row[name]) for name in ("pin", "mode", "function")),
                _wave(row) or str(row["level"]),
                *(str(row[name]) for name in ("chip", "outside")),
                str(row["edges"]) if row["edges"] else "",
                f"{last:.6f} s" if isinstance(last, float) else "",
                "yes" if row["five_volt"] else "no",
            )
        )
    typer.echo("\n".join(in_columns(headers, table, right=(6, 7))))


def _wave(row: dict[str, object]) -> str:
    """Return frequency and duty of a pin's wave; empty for none."""
    frequency_hz, duty = row["frequency_hz"], row["duty"]
    if not isinstance(frequency_hz, float) or not isinstance(duty, float):
        return ""
    return f"{frequency_hz:g} Hz, {100 * duty:.1f} %"
