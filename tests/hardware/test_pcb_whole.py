"""What the board's checks compute and say, whole: every figure, deck, finding and line about a wrong circuit."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

from adapter_sim.pinout import load_pinout
from hardware.pcb.checks.pin_checks import BOARDS, findings
from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.circuit.electrical import all_checks
from hardware.pcb.proof.expected import differences
from hardware.pcb.proof.mutants import apply, draw, draw_whole, load
from hardware.pcb.spice import run
from hardware.pcb.spice.decks import decks
from tests.tools.suite.golden import kept_in

is_as_kept = kept_in("hardware")


def figures() -> list[str]:
    """Return every electrical figure of every variant, with its limits and what is to be known about it."""
    return [
        f"{variant}: {check}{f' [{check.note}]' if check.note else ''}"
        for variant in VARIANTS
        for check in all_checks(build(variant))
    ]


def simulated() -> list[str]:
    """Return what each deck has that none before has, as the simulator reads it, and the digest of the whole."""
    found, seen = [], set[str]()
    for deck in decks():
        whole = [*run.deck_text(deck, Path("TRACES")).splitlines(), *map(str, deck.limits), *map(str, deck.traces)]
        whole.append(f"{deck.x_label} * {deck.x_scale:g}, {deck.y_label}")
        digest = hashlib.sha256("\n".join(whole).encode()).hexdigest()[:16]
        found += [f"=== {deck.name}: {len(whole)} lines, {digest}", *(line for line in whole if line not in seen)]
        seen |= {*whole}
    return found


def rules() -> list[str]:
    """Return what the pin rules find on each board."""
    pinout = load_pinout()
    return [f"{name}: {finding}" for name, board in BOARDS.items() for finding in findings(pinout, board)]


def wrong_circuits() -> list[str]:
    """Return what is said of the listed wrong circuits, and which others are drawn by a seed."""
    design = build()
    said = [f"{one.name}: {line}" for one in load()[::3] for line in differences(apply(design, one))]
    drawn = [*draw(design, 7)[::9], *draw_whole(design, seed=7)[::9]]
    return [*said, *(f"{one.rule}: {one.name}: {', '.join(one.edits)}" for one in drawn)]


WHOLE: dict[str, Callable[[], list[str]]] = {
    "figures": figures, "decks": simulated, "pin-rules": rules, "wrong-circuits": wrong_circuits,
}  # fmt: skip


@pytest.mark.parametrize("name", WHOLE)
def test_it_is_what_it_was(name: str) -> None:
    assert is_as_kept(WHOLE[name](), name)
