"""A recorded run, read back from its `trace.jsonl`, and the variables that were recorded beside it.

The trace is the single source: every picture and table of a report is made
from it, so a run that was cut short (Ctrl-C, kill -9, a full disk) still has a
report up to its last complete line.

Invariant: reading never fails on a trace that ends early; it fails with
`TraceError` on a folder that holds no trace at all.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, cast

from p2os.robots.motor_step import STEP_MPS
from robot_bench.events.codec import (
    LAST_NS,
    TRACE,
    Blocks,
    EdgeBlock,
    Json,
    Levels,
    TraceError,
    damaged,
    entries_of,
    event_of,
    events_of,
)
from robot_bench.events.kinds import (
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.events.whole_lines import check_whole_line
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.variables import VariableRecord, read_variables
from robot_bench.wires.edges import Edges
from simbase.files import lines_of
from simbase.timing import NS_PER_S


@dataclass(slots=True, kw_only=True, repr=False)
class RunRecord:
    """All that a trace holds, sorted by kind, each list in order of time."""

    meta: Json = field(default_factory=dict)
    end: Json = field(default_factory=dict)
    poses: list[Pose] = field(default_factory=list)
    #: Net name → edges as (ns, level), the first of each at 0.
    pins: dict[str, Edges] = field(default_factory=dict)
    #: Net name → waves as (ns, wave from then on, None for a level again); the level in `pins` is 0 during a wave.
    waves: dict[str, list[tuple[int, Wave | None]]] = field(default_factory=dict)
    #: The nets in the order of the trace's blocks.
    nets: tuple[str, ...] = ()
    sonar: list[tuple[int, list[int]]] = field(default_factory=list)
    usart: list[tuple[int, bytes]] = field(default_factory=list)
    #: What other ports printed.
    other_texts: list[Text] = field(default_factory=list)
    #: What went over the buses that were recorded, by their ends.
    transfers: list[SpiTransfer | I2cTransfer | CanTransfer] = field(default_factory=list)
    wire: list[Packet] = field(default_factory=list)
    #: The state log.
    events: list[Note] = field(default_factory=list)
    changes: list[WorldChange] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    clearances: list[Clearance] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)
    #: Of the program, where the run was asked for them; they stand beside the trace.
    variables: list[VariableRecord] = field(default_factory=list)
    last_ns: int = 0
    #: True where the trace has no end line, or its last line was cut.
    is_cut: bool = True

    def __repr__(self) -> str:
        name = self.meta.get("scenario", "a run")
        return (
            f"<RunRecord of {name}, {self.last_ns / NS_PER_S:g} s, {len(self.poses)} poses, {len(self.events)} notes>"
        )

    @property
    def step_mps(self) -> float:
        """Rim speed of one step of a motor value, m/s."""
        return float(cast("float", self.meta.get("step_mps") or STEP_MPS))

    def usart_lines(self) -> list[tuple[int, str]]:
        """Return (ns of its last character, text) for each printed line."""
        lines, pending = [], b""
        for t, data in self.usart:
            pending += data
            *whole, pending = pending.split(b"\n")
            lines += [(t, line.decode("utf-8", "replace").rstrip("\r")) for line in whole]
        if pending:
            lines.append((self.usart[-1][0], pending.decode("utf-8", "replace")))
        return lines


def read_run(folder: Path) -> RunRecord:
    """Read a run folder's trace, and its variables.

    Raises:
        TraceError: The folder or its trace is missing, its first line is no trace, or the variables are damaged.
    """
    path = _trace_in(folder)
    record = record_of(lines_of(path, TraceError), str(path))
    if not record.meta:
        raise TraceError(f"{path} does not start with a trace's meta line", hint="was it made by `p2os run`?")
    record.variables = read_variables(folder)
    return record


def read_events(folder: Path) -> Iterator[Event]:
    """Play back a run folder's trace.

    Raises:
        TraceError: The folder or its trace is missing, or a line is damaged.
    """
    path = _trace_in(folder)
    yield from events_of(lines_of(path, TraceError), str(path))


def read_meta(folder: Path) -> Json:
    """Return the first entry of a run folder's trace: what was run, where, with what robot; empty where it has none.

    Raises:
        TraceError: The folder or its trace is missing, or its first line is damaged.
    """
    path = _trace_in(folder)
    return record_of(islice(lines_of(path, TraceError), 1), str(path)).meta


def _trace_in(folder: Path) -> Path:
    path = folder / TRACE_NAME
    if not path.is_file():
        raise TraceError(f"{folder} holds no {TRACE_NAME}", hint="give the folder that `p2os run --out DIR` wrote")
    return path


def record_of(lines: Iterable[str], where: str = "the trace") -> RunRecord:
    """Return what the lines of a trace hold.

    Raises:
        TraceError: A line is damaged, or of a later version.
    """
    record, blocks = RunRecord(), Blocks()
    for number, entry in enumerate(entries_of(lines), start=1):
        try:
            _file(record, blocks, entry)
        except TraceError as error:
            raise TraceError(f"{where}:{number}: {error}", hint=error.hint) from error
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise damaged(where, number) from error
    return record


def _file(record: RunRecord, blocks: Blocks, entry: Json) -> None:
    """Put one entry where it belongs; kinds that a later version adds are passed over."""
    kind = entry.get("k")
    check_whole_line(entry)
    if kind == "meta":
        record.meta = _meta(entry)
        return
    if kind == "end":
        record.end = entry
        record.is_cut = False
        return
    event = event_of(entry)
    if event is None:
        at = entry.get("t")
        record.last_ns = max(record.last_ns, at if type(at) is int and at <= LAST_NS else 0)
        return
    record.last_ns = max(record.last_ns, event.t)
    if isinstance(event, Levels):
        blocks.begin(event)
        record.nets = event.nets
        for net, level in zip(event.nets, event.levels, strict=True):
            record.pins[net] = Edges([(event.t, int(level))])
    elif isinstance(event, EdgeBlock):
        for net, edges in blocks.take(event):
            record.pins[net].extend(edges.times, edges.levels)
            record.last_ns = max(record.last_ns, edges.times[-1])
    else:
        _FILES[type(event)](record, event)


#: Where an event is put.
_FILES: Mapping[type, Callable[[RunRecord, Any], None]] = {
    Pose: lambda record, pose: record.poses.append(pose),
    PinEdge: lambda record, edge: record.pins.setdefault(edge.wire, Edges()).append(edge.t, edge.level),
    Ranges: lambda record, ranges: record.sonar.append((ranges.t, list(ranges.mm))),
    Text: lambda record, text: (
        record.usart.append((text.t, text.data)) if text.port == "usart1" else record.other_texts.append(text)
    ),
    SpiTransfer: lambda record, spi: record.transfers.append(spi),
    I2cTransfer: lambda record, i2c: record.transfers.append(i2c),
    CanTransfer: lambda record, can: record.transfers.append(can),
    Packet: lambda record, packet: record.wire.append(packet),
    Note: lambda record, note: record.events.append(note),
    WorldChange: lambda record, change: record.changes.append(change),
    Contact: lambda record, hit: record.contacts.append(hit),
    Clearance: lambda record, clearance: record.clearances.append(clearance),
    Fault: lambda record, fault: record.faults.append(fault),
    Wave: lambda record, wave: record.waves.setdefault(wave.wire, []).append((wave.t, wave if wave.period else None)),
    Verdict: lambda record, verdict: record.verdicts.append(verdict),
}


def _meta(entry: Json) -> Json:
    """Return the first line of a trace that this version reads."""
    TRACE.version_of(entry.get("trace"), error=TraceError)
    return entry
