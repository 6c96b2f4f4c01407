"""GDB's `monitor` commands: what a board has that GDB has no word for.

Invariant: any words give lines for a person, never an exception.
"""

from bluepill_sim.debug.machine import DebugTarget
from bluepill_sim.errors import BluePillError
from bluepill_sim.spans import to_nanos
from simbase.timing import NS_PER_S

_LEVELS = {"0": False, "1": True, "low": False, "high": True, "z": None}
_UNKNOWN = "not understood; monitor help lists the commands"


#: How a command is called, and what it does; the first word names its method.
COMMANDS = {
    "help": "this list",
    "reset": "press the reset button (halt and init are taken as well); time goes on",
    "time": "virtual time, cycles, clock",
    "wait 10ms": "let time pass with the core halted; DBGMCU_CR says which watchdogs stand still",
    "pins [all]": "pins in use: mode, level, who drives",
    "pin PA4 [1|0|z]": "one pin; with a level: drive it from outside, z lets go",
    "registers TIM3 [CR1]": "registers of a peripheral with their fields",
    "snapshot [NAME]": "keep the whole machine's state",
    "restore [NAME]": "go back to it",
    "fault": "the fault, if there was one, with what ran before it",
    "blocks": "the last 32 blocks and exceptions (those before the fault, if there was one)",
    "warnings": "what was touched that is not modelled, and electrical mistakes",
}


#: What changes the machine; `pin` does with a level.
_WRITING = frozenset({"reset", "wait", "restore"})


class Monitor:
    """Carries out the commands for one debugger.

    Args:
        target: the machine, standing still.
    """

    def __init__(self, target: DebugTarget) -> None:
        self._target = target
        self._snapshots: dict[str, object] = {}

    def run(self, line: str) -> str:
        """Return the output of a command."""
        name, *words = line.split() or ["help"]
        is_known = any(usage.split()[0] == name for usage in COMMANDS)
        if self._target.read_only and (name in _WRITING or (name == "pin" and len(words) > 1)):
            return f"{self._target.read_only}\n"
        return (getattr(self, f"_{name}")(words) if is_known else f"{line}: {_UNKNOWN}") + "\n"

    def _help(self, _words: list[str]) -> str:
        return "\n".join(f"{usage:<22} {text}" for usage, text in COMMANDS.items())

    def _reset(self, _words: list[str]) -> str:
        board = self._target.machine.board
        board.reset()
        self._target.changed()
        return f"reset: at {board.where()}"

    def _time(self, _words: list[str]) -> str:
        board = self._target.machine.board
        parts = [f"{board.now_ns / NS_PER_S:.9f} s of virtual time", f"{board.cycle} cycles"]
        parts += [f"{board.hclk_hz / 1e6:g} MHz", *(["asleep"] if board.is_asleep else [])]
        return ", ".join(parts)

    def _wait(self, words: list[str]) -> str:
        machine = self._target.machine
        board = machine.board
        try:
            [span_ns] = map(to_nanos, words)
        except (BluePillError, ValueError):
            return f"wait {' '.join(words)}: {_UNKNOWN}"
        end_ns = board.now_ns + span_ns
        if machine.end_ns is not None:
            end_ns = min(end_ns, machine.end_ns)
        before = board.resets.copy()
        with board.chip.halted_core():
            while board.now_ns < end_ns:
                machine.advance_to(end_ns)
        self._target.changed()
        causes = ", ".join(cause.name for cause in board.resets - before)
        return f"{self._time([])}{f'; reset by {causes}: at {board.where()}' if causes else ''}"

    def _pins(self, words: list[str]) -> str:
        names = [pin.name for pin in self._target.machine.board.pins]
        lines = [self._line(name, every=bool(words)) for name in names]
        return "\n".join(line for line in lines if line) or "no pin is in use"

    def _line(self, name: str, *, every: bool) -> str:
        pin = self._target.machine.board.pin(name)
        if not every and pin.mode.value == "floating input" and pin.driven is None and pin.holder is None:
            return ""
        level = "floating" if pin.is_floating else "high" if pin.level else "low"
        if pin.wave is not None:
            level = f"{pin.wave.frequency_hz:g} Hz, {100 * pin.wave.duty:.1f} %"
        outside = {None: "", True: ", high from outside", False: ", low from outside"}[pin.driven]
        use = pin.holder or pin.function or ""
        return f"{name:<5} {level:<9} {pin.mode.value}{f' ({use})' if use else ''}{outside}"

    def _pin(self, words: list[str]) -> str:
        board = self._target.machine.board
        bonded = {pin.name for pin in board.pins}
        name = words[0].upper() if words else ""
        if name not in bonded or len(words) > 2 or (len(words) == 2 and words[1].lower() not in _LEVELS):
            return f"pin {' '.join(words)}: {_UNKNOWN}"
        if len(words) == 2:
            board.pin(name).drive(_LEVELS[words[1].lower()])
            self._target.changed()
        return self._line(name, every=True)

    def _registers(self, words: list[str]) -> str:
        board = self._target.machine.board
        parts = board.chip.parts.by_name
        if not words:
            return ", ".join(parts)
        name, *wanted = (word.upper() for word in words)
        if name not in parts or len(wanted) > 1:
            return f"registers {' '.join(words)}: {_UNKNOWN}"
        views = board.registers(name)
        if not wanted:
            return "\n".join(f"{view.name:<8} {view}" for view in views.values())
        if wanted[0] not in views:
            return f"{name} has no {wanted[0]}; it has {', '.join(views)}"
        view = views[wanted[0]]
        return "\n".join(
            [
                f"{name}_{view.name} at {view.address:#010x}: {view.word:#010x}",
                *(f"{field:<12} {value:#x}" for field, value in view.fields),
            ]
        )

    def _snapshot(self, words: list[str]) -> str:
        if not self._target.machine.can_rewind:
            return "a real robot cannot go back: no snapshots"
        name = words[0] if words else "1"
        self._snapshots[name] = self._target.machine.snapshot()
        return f"snapshot {name} at {self._time([])}"

    def _restore(self, words: list[str]) -> str:
        name = words[0] if words else "1"
        if name not in self._snapshots:
            return f"no snapshot {name}; there are: {', '.join(sorted(self._snapshots)) or 'none'}"
        self._target.machine.restore(self._snapshots[name])
        self._target.changed()
        return f"restored {name}: {self._time([])}; say maintenance flush register-cache"

    def _fault(self, _words: list[str]) -> str:
        fault = self._target.machine.board.fault
        if fault is None:
            return "no fault"
        return "\n".join([f"{fault}\n{fault.register_dump}", *self._target.machine.board.last_blocks()])

    def _blocks(self, _words: list[str]) -> str:
        return "\n".join(self._target.machine.board.last_blocks()) or "nothing has run yet"

    def _warnings(self, _words: list[str]) -> str:
        return "\n".join(self._target.machine.board.warnings) or "no warnings"
