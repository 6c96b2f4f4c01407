"""What is done to a run where a fork of it begins: a fault, a level, volts, characters, a thing; in words.

fault sonar-stuck 3 0.2       as `[[fault]]` of a scenario has it; `clear` sets it right again
press stop-button             a button of the robot, held
pin bumper_front low          a level on a wire or a free pin (high, low)
volts PA0 2.6                 volts on a pin of the BluePill
type usart1 go                characters and a line end, into a USART
remove box 1                  a thing of the world is taken away
move box 1 to 1.5 0           or put elsewhere: x and y, metres
"""

from collections.abc import Callable, Mapping

from p2os.errors import ScenarioError
from robot_bench.bench import Bench, run_of
from robot_bench.scenario.hand_script import Action, SetPinTable, SetVoltsTable, TypeTable, actions_of
from simbase.errors import UsageError, nearest, shown


def _type(bench: Bench, rest: str) -> None:
    port, _, text = rest.partition(" ")
    if port not in {"usart1", "usart2", "usart3"}:
        raise ScenarioError(f"there is no port {shown(port)}", hint="usart1, usart2 or usart3")
    _by_hand(bench, TypeTable(text=f"{text}\n", port=port), "type")  # type: ignore[arg-type]  # looked at by now


def _pin(bench: Bench, rest: str) -> None:
    pin, _, level = rest.rpartition(" ")
    if level not in {"high", "low"}:
        raise ScenarioError(f"{shown(level)} is no level", hint="high or low")
    _by_hand(bench, SetPinTable(pin=pin, level=level), "set_pin")  # type: ignore[arg-type]  # likewise


def _volts(bench: Bench, rest: str) -> None:
    pin, _, volts = rest.rpartition(" ")
    _by_hand(bench, SetVoltsTable(pin=pin, volts=float(volts)), "set_volts")


def _by_hand(bench: Bench, table: TypeTable | SetPinTable | SetVoltsTable, do: str) -> None:
    own = bench.scenario.own_robot
    # An action acts on what comes after it; this moment may be over.
    actions = actions_of(table, do, "fork", None if own is None else own.wires)
    run_of(bench).take_inputs([Action(at=bench.now + 1 + one.at, do=one.do, place=one.place, text=one.text,
                                      level=one.level, volts=one.volts) for one in actions])  # fmt: skip


def _move(bench: Bench, rest: str) -> None:
    name, _, place = rest.rpartition(" to ")
    x_m, y_m = map(float, place.split())
    bench.move(name, x_m=x_m, y_m=y_m)


#: First word → how it is written, and what does it.
CHANGES: Mapping[str, tuple[str, Callable[[Bench, str], None]]] = {
    "fault": ("fault sonar-stuck 3 0.2", lambda bench, rest: bench.inject(rest)),
    "clear": ("clear sonar-stuck 3", lambda bench, rest: bench.clear(rest)),
    "press": ("press stop-button", lambda bench, rest: bench.press(rest)),
    "pin": ("pin bumper_front low", _pin),
    "volts": ("volts PA0 2.6", _volts),
    "type": ("type usart1 TEXT", _type),
    "remove": ("remove NAME", lambda bench, rest: bench.remove(rest)),
    "move": ("move NAME to X Y", _move),
}


def change(bench: Bench, words: str) -> None:
    """Do to a bench, now, what a line of words means.

    Raises:
        UsageError: They mean nothing that can be done.
        P2osError: It cannot be done there.
    """
    name, _, rest = words.strip().partition(" ")
    row = CHANGES.get(name)
    if row is None:
        hint = nearest(name, CHANGES, "; ".join(usage for usage, _ in CHANGES.values()))
        raise UsageError(f"nothing is done by {shown(words)}", hint=hint)
    usage, do = row
    try:
        do(bench, rest.strip())
    except ValueError as error:
        raise UsageError(f"{shown(words)} is not understood: {error}", hint=f"such as {usage}") from error
