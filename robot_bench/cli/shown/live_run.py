"""A run that goes on, for whoever looks at it and controls it: what the trace is written of, handed over as it is.

Pages' commands wait in a queue until the bench stands between two slices. Nothing of a run that is known is handed over
a second time: a bench that was set back comes by the same again.

What hands do in the run itself is written into its folder at once, as a scenario that is that run without a page.

Invariant: nobody who looks on decides anything: the trace is the same with and without.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

from bluepill_sim.cli.gdb_server import GdbPort
from bluepill_sim.errors import BluePillError
from bluepill_sim.program.image import load_image
from bluepill_sim.program.variables import VariableTable, read_variables
from p2os.cli.robots.drive_deadman import DriveDeadman
from p2os.cli.robots.page_control import QueuedControl
from p2os.transport.wall_clock import Clock, wall_clock
from p2os.view.header import PageHeader, PanelHeader, PanelState
from p2os.view.live import LiveRecording
from p2os.view.recording import ViewRecording
from p2os.view.run_control import MOST_DPS, MOST_MPS, RunCommand, RunState
from p2os.view.targets import panels_of
from robot_bench.bench import Bench, run_of
from robot_bench.cli.debugging.future import Future, SeenStretch
from robot_bench.cli.debugging.gdb_beside import GdbBeside
from robot_bench.cli.debugging.session import MAIN, RunSession
from robot_bench.cli.shown.looked_panels import LookedPanels
from robot_bench.cli.shown.offered_hands import hands_of
from robot_bench.cli.shown.saved_hands import saved_beside, scenario_text
from robot_bench.events.codec import Blocks, Json, Recorded
from robot_bench.recording.run_folder import HANDS_NAME
from robot_bench.report.run_page import lead_of
from robot_bench.run import meta_of
from robot_bench.scenario.hands.timed import Hand
from robot_bench.scenario.scenario import Scenario
from robot_bench.view.run_tracks import RunTracks, add_events
from robot_bench.view.variable_track import VariableTrack
from simbase.files import write_text
from simbase.timing import Nanos

#: chosen: how long a command of a page waits at most while GDB is listened for, seconds.
GDB_WAIT_S = 0.02
#: chosen: how long a signal may wait to be looked at where a run stands still, seconds.
_WAIT_S = 0.2


@dataclass(frozen=True, slots=True)
class BenchBuilt:
    """What is run, on what, in what: the first entry of the trace; and the panels of its chip."""

    meta: Json
    panels: Sequence[PanelHeader]


@dataclass(frozen=True, slots=True)
class BenchReleased:
    """What was handed on at once in a future."""

    events: Sequence[Recorded]
    future: str = MAIN


@dataclass(frozen=True, slots=True)
class FutureForked:
    """A future has left another one, whose past it shares up to a time."""

    future: str
    parent: str
    until_ns: Nanos
    #: Names of all wires.
    nets: tuple[str, ...]
    levels: bytes


@dataclass(frozen=True, slots=True)
class FutureDropped:
    """A future is there no more."""

    future: str


@dataclass(frozen=True, slots=True)
class VariablesSeen:
    """What was seen of the program's variables in a future."""

    future: str
    stretches: Sequence[SeenStretch]
    #: Name → type, of those that are watched.
    types: Mapping[str, str]


Happened = BenchBuilt | BenchReleased | FutureForked | FutureDropped | VariablesSeen


class LiveRun(QueuedControl):
    """Hands over what happens on a bench, and does there what pages ask for.

    Args:
        scenario: What will be run.
        speed: Virtual seconds a second at first; 0 as fast as it goes.
        variables: Names of the program's variables that are watched from the beginning.
        on_wait: Called while it stands still; may raise to end the run.
        clock: Wall clock, ns.
        gdb: Where GDB comes, beside the page: it stands at first until that, or a page lets it go; None: it does not.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        speed: float = 1.0,
        variables: Sequence[str] = (),
        on_wait: Callable[[], None] = lambda: None,
        clock: Clock = wall_clock,
        gdb: GdbPort | None = None,
    ) -> None:
        super().__init__(RunState(is_running=True, speed=speed))
        self._gdb_port = gdb
        self._gdb: GdbBeside | None = None
        self._scenario = scenario
        self._recording = ViewRecording(PageHeader(title=scenario.name, hands=hands_of(scenario)))
        self._tracks: dict[str, RunTracks] = {}
        #: Future and name → the channel of a variable.
        self._seen: dict[tuple[str, str], VariableTrack] = {}
        self._blocks: dict[str, Blocks] = {}
        self._speed, self._on_wait, self._clock = speed, on_wait, clock
        self._variables = variables
        self._panels = LookedPanels(())
        #: Whose chip the panels show.
        self._shown_bench: Bench | None = None
        self._session: RunSession | None = None
        self._folder: TemporaryDirectory[str] | None = None
        #: The run's own, and what is written there.
        self._run_folder: Path | None = None
        self._written: Sequence[Hand] = ()
        self._drive = DriveDeadman(MOST_MPS, MOST_DPS)
        #: Whether it goes on to be controlled when the run is over, by `stay`.
        self.stays = False
        #: What a server shows.
        self.source: LiveRecording[Happened] = LiveRecording(self._recording, self._add)
        self.source.control = self

    # As the page's `RunControl`.

    def offered(self, begun: str) -> Sequence[str]:
        """Return names of variables that what was typed may become."""
        try:
            return self._table.offered(begun)
        except BluePillError:
            return ()

    @cached_property
    def _table(self) -> VariableTable:
        """The program's variables; read once, for each letter that is typed asks for them."""
        return read_variables(load_image(self._scenario.firmware))

    def look(self, panel: str, choice: str) -> PanelState | None:
        """Return what a panel showed last; while it is asked for, it is looked at ten times a second."""
        return self._panels.asked(panel, choice)

    # As what runs the bench.

    def drive(self, bench: Bench) -> None:
        """Run a bench to its end, as `run_scenario` takes it."""
        meta = meta_of(bench.scenario, bench.parts.world, run_of(bench).note, is_at_port=False)
        panels = panels_of(bench.chip)
        self.source.offer(BenchBuilt(meta, [one.header for one in panels]), bench.now, is_kept=True)
        has_folder = bench.trace.path is not None and bench.scenario.has_robot
        self._run_folder = bench.trace.path.parent if has_folder and bench.trace.path is not None else None
        self._folder = TemporaryDirectory(prefix="p2os-view-")
        waits = "" if self._gdb_port is None else f"waiting for GDB on port {self._gdb_port.port}"
        session = self._session = RunSession(bench, self, Path(self._folder.name), self._speed, waits)
        self._gdb = None if self._gdb_port is None else GdbBeside(session, self._gdb_port)
        session.watch(self._variables)
        self._panels.replace(panels)
        self._shown_bench = bench
        try:
            while not session.is_over or session.is_running:
                self._turn(session)
            if self.stays:
                session.replace_main(Path(self._folder.name) / "run.jsonl")
        except BaseException:
            self.stays = False
            session.end()
            raise
        finally:
            if not self.stays:
                self.source.end()
                self._folder.cleanup()

    def stay(self) -> None:
        """Go on to do what pages ask for, when the run is over, until an interrupt."""
        assert self._session is not None  # noqa: S101 - `drive` has made both
        assert self._folder is not None  # noqa: S101 - as above
        try:
            while True:
                self._turn(self._session)
        finally:
            self._folder.cleanup()

    def _turn(self, session: RunSession) -> None:
        """Do a command, or run a slice."""
        now = self._clock()
        if self._drive.is_driving:
            self._drive.advance_to(now)
            if not self._drive.is_driving:
                self._do(session, RunCommand(do="stop"))
        wait_s = session.go_on(now) if session.is_running else _WAIT_S
        self._hand_over_variables(session)
        self._look_at_panels(session)
        self._show(session.state())
        if wait_s:
            self._on_wait()
        if self._gdb is not None:
            self._gdb.serve(min(wait_s, GDB_WAIT_S))
            wait_s = 0
        if (command := self._commands.take(wait_s)) is not None:
            self._do(session, command)

    def _do(self, session: RunSession, command: RunCommand) -> None:
        """Do what was asked for."""
        if command.do == "drive":
            self._drive.ask(command.forward_mps, command.turn_dps, self._clock())
        elif command.do == "stop":
            self._drive.stop()
        if command.do in {"drive", "stop"}:
            forward_mps, turn_dps = self._drive.speeds
            command = RunCommand(do="drive", forward_mps=forward_mps, turn_dps=turn_dps)
        session.do(command)
        if session.hands != self._written and self._run_folder is not None:
            self._written = session.hands
            text = scenario_text(self._scenario, self._written, self._run_folder)
            write_text(self._run_folder / HANDS_NAME, text)
        self._hand_over_variables(session)
        self._show(session.state())

    def _look_at_panels(self, session: RunSession) -> None:
        """Look at the panels that somebody looks at: at most ten times a second of the clock."""
        clock_ns = self._clock()
        if not self._panels.is_due(clock_ns):
            return
        if session.chosen.bench is not self._shown_bench:
            self._shown_bench = session.chosen.bench
            self._panels.replace(panels_of(self._shown_bench.chip))
        self._panels.look(clock_ns, session.chosen.now_ns)

    def _hand_over_variables(self, session: RunSession) -> None:
        for future, types in session.watched():
            if stretches := future.take_seen():
                self.source.offer(VariablesSeen(future.name, stretches, types), future.known_ns)

    # As the session's `FutureRecorder`.

    def begin(self, future: Future) -> None:
        """Hand over what a future's bench reports from now on."""

        def take(events: Sequence[Recorded], limit: Nanos) -> None:
            if limit <= future.known_ns:
                return
            future.known_ns = limit
            if events:
                self.source.offer(BenchReleased(events, future.name), limit)
            else:
                self.source.advance_to(limit)

        future.bench.events.record(take)

    def forked(self, future: Future, parent: Future) -> None:
        """Take a future that has left another one."""
        blocks = Blocks() if future.mark is None else future.mark[1]
        happened = FutureForked(
            future.name, parent.name, future.bench.events.released_until, blocks.nets, bytes(blocks.levels)
        )
        self.source.offer(happened, max(parent.known_ns, future.known_ns), is_kept=True)
        self.begin(future)

    def dropped(self, future: Future) -> None:
        """Forget a future."""
        self.source.offer(FutureDropped(future.name), future.known_ns, is_kept=True)

    def saved(self, future: Future, kind: str) -> str:
        """Write down what hands have done in a future beside the run's folder, as a scenario or a test; say where."""
        name = "" if future.name == MAIN else future.name
        return saved_beside(self._scenario, future.hands, self._run_folder, kind, name)

    def _add(self, happened: Happened) -> None:
        if isinstance(happened, BenchBuilt):
            header = replace(self._recording.header, lead=lead_of(happened.meta), panels=happened.panels)
            self._recording.header = header
            self._tracks[MAIN], self._blocks[MAIN] = RunTracks(self._recording, happened.meta), Blocks()
        elif isinstance(happened, FutureForked):
            self._tracks[happened.future] = self._tracks[happened.parent].forked(happened.future, happened.until_ns)
            self._blocks[happened.future] = Blocks(happened.nets, bytearray(happened.levels))
            for (future, name), one in [*self._seen.items()]:
                if future == happened.parent:
                    track = self._tracks[happened.future].variable(name, "")
                    self._seen[happened.future, name] = one.forked(track, happened.until_ns)
        elif isinstance(happened, VariablesSeen):
            self._add_variables(happened)
        elif isinstance(happened, FutureDropped):
            self._recording.dropped.add(happened.future)
            self._recording.header = replace(
                self._recording.header,
                robots=[one for one in self._recording.header.robots if one.name != happened.future],
            )
        else:
            self._add_events(happened)

    def _add_variables(self, happened: VariablesSeen) -> None:
        for stretch in happened.stretches:
            for name, type_name in happened.types.items():
                key = happened.future, name
                if key not in self._seen:
                    self._seen[key] = VariableTrack(self._tracks[happened.future].variable(name, type_name))
                rows = [(at, value) for at, one, value in stretch.rows if one == name]
                self._seen[key].take(stretch.begins_ns, stretch.until_ns, rows)

    def _add_events(self, happened: BenchReleased) -> None:
        add_events(self._tracks[happened.future], self._blocks[happened.future], happened.events)
