"""[[part]] of a scenario: what is plugged into the board besides its robot (docs/parts.md).

Invariant: a part that was read can be made, and stands on no wire of the robot's.
"""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from bluepill_sim.parts.registry import GROUP, PARTS, PartSpec, build
from bluepill_sim.stm32f103 import BONDED_PINS
from p2os.errors import ScenarioError
from p2os.toml_schema import Key, Table, TablePlace, Where, placed, within
from simbase.errors import shown, shown_name
from simbase.trust import Code, Trust

#: The keys of every part; all others are its pins and settings.
KEYS = (
    Key(name="kind", kind="text", required=True, choices=tuple(PARTS), group=GROUP),
    Key(name="name", kind="text"),
    Key(name="on", kind="text"),
    Key(name="select", kind="text"),
)
_SCALARS = (str, int, float, bool)


def load_parts(
    tables: Sequence[Table], folder: Path, taken: Mapping[str, str], where: Where, trust: Trust
) -> tuple[PartSpec, ...]:
    """Return the parts of a scenario.

    Args:
        tables: The `[[part]]` tables.
        folder: Where their files are.
        taken: Pins of the chip that the robot has: pin → its signal.
        where: The file, for messages.
        trust: Which code of theirs may be executed; the part of code that is only read is not made.

    Raises:
        UntrustedError: A part is code, and nobody has said that it may be executed.
        ScenarioError: There is no such part, or it cannot be plugged in so.
    """
    found = []
    for number, table in enumerate(tables):
        at = within(where, "part", number)
        found.append(_load(table, folder, taken, at, trust))
    return tuple(found)


def _load(table: Table, folder: Path, taken: Mapping[str, str], at: Where, trust: Trust) -> PartSpec:
    for known in KEYS:
        text = table.get(known.name)
        if known.required and text is None:
            raise ScenarioError(f"{at}: key {known.name!r} is missing", hint="p2os mcu parts lists what there is")
        if text is not None and not isinstance(text, str):
            raise ScenarioError(f"{at}: {known.name} = {shown(text)} is not a text in quotes")
    settings = {key: value for key, value in table.items() if key != "kind"}
    for name, value in settings.items():
        if not isinstance(value, _SCALARS) and not (
            isinstance(value, list) and all(isinstance(x, _SCALARS) for x in value)
        ):
            raise ScenarioError(f"{at}: {name} = {shown(value)} is no number, text, flag or list of them")
    kept = tuple((key, tuple(value) if isinstance(value, list) else value) for key, value in settings.items())
    named = f"{at.at('kind') if isinstance(at, TablePlace) else at}: kind"
    kind = trust.admit(str(table["kind"]), folder, named)
    spec = PartSpec(kind=kind, settings=kept, folder=str(folder))
    if isinstance(kind, Code) and kind.is_unread:
        return spec
    with placed(at):
        wiring = build(spec)
    _refuse_taken([*wiring.pins.values(), *filter(None, [wiring.select])], taken, at)
    return spec


def _refuse_taken(pins: Collection[str], taken: Mapping[str, str], at: Where) -> None:
    for pin in pins:
        if pin.upper() not in BONDED_PINS:
            raise ScenarioError(
                f"{at}: the chip has no leg {shown_name(pin)}", hint="PA0 to PA15, PB0 to PB15, PC13 to PC15"
            )
        if pin.upper() in taken:
            raise ScenarioError(
                f"{at}: {pin.upper()} is the robot's {taken[pin.upper()]}", hint="take a pin that it does not have"
            )
