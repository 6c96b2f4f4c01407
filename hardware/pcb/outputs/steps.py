"""A picture a step: what is soldered, measured, flashed and wired, in the order of docs/board-build.md.

Each is the board from above with the step's parts marked, and a line from each pad that is meant to words beside the
board. Places and nets come from the design: a part that moves takes its picture along. Not here: the steps' text.

Invariant: same design, same bytes; every part that is bought is marked in exactly one of the soldering steps.
"""

import html
import re
from collections.abc import Iterator
from dataclasses import dataclass

from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS
from hardware.pcb.circuit.netlist import BoardDesign, Component
from hardware.pcb.layout import rules
from hardware.pcb.layout.placement import place
from hardware.pcb.layout.routing import PlacedPad, placed_pads
from hardware.pcb.outputs.assembly import body_mm


@dataclass(frozen=True, slots=True, kw_only=True)
class AssemblyStep:
    """One step: its title, the parts by reference, and words at pads (`J1.1`; of a module the print: `U1.PA9`)."""

    title: str
    parts: str
    is_soldering: bool = True
    #: A pad and the words beside it; a pad that a variant lacks has none.
    notes: tuple[tuple[str, str], ...] = ()


STEPS: tuple[AssemblyStep, ...] = (
    AssemblyStep(title="chips and transistors: the dot is pin 1", parts=r"U5|U6|Q\d",
                 notes=(("U5.1", "pin 1 of U5"), ("U6.1", "pin 1 of U6"), ("Q1.1", "Q1, Q2: BC817"),
                        ("Q3.1", "Q3, Q4: BC807"))),
    AssemblyStep(title="resistors, small capacitors", parts=r"R\d+|C([2-9]|1\d)",
                 notes=(("R12.1", "R12: 680R, the others of its column 1k2"), ("R33.2", "R33, R44: up to 3.3 V"))),
    AssemblyStep(title="diodes and lights: the bar is the cathode", parts=r"D([13-9]|10)",
                 notes=(("D1.K", "D1: bar here"), ("D3.K", "D3"), ("D4.K", "D4"), ("D5.K", "D5"),
                        ("D6.K", "D6: bar here"),
                        ("D7.K", "D7, D8"), ("D10.K", "D10"))),
    AssemblyStep(title="fuses, suppressor", parts=r"F\d|D2", notes=(("D2.K", "D2: bar here"), ("F2.1", "F2"))),
    AssemblyStep(title="regulator, C1, button, headers", parts=r"U3|U4|C1|SW1|JP\d|J[457]",
                 notes=(("C1.1", "C1: plus here"), ("U3.1", "U3: IN"), ("J7.1", "J7: jumper on"),
                        ("JP1.2", "JP1: one jumper"))),
    AssemblyStep(title="terminal, bank, plug, ribbon", parts=r"J[1236]",
                 notes=(("J1.1", "opening to the edge"), ("J3.5", "J3: both locks soldered"),
                        ("J6.1", "J6: gap at pin 1"))),
    AssemblyStep(title="sockets of the modules", parts=r"U[12]",
                 notes=(("U1.PB12", "USB of the BluePill here"), ("U2.IO6", "USB of the ESP32 here"))),
    AssemblyStep(title="first power-up, without modules", parts=r"J1|TP\d+", is_soldering=False,
                 notes=(("J1.1", "+ 12.0 V, limit 100 mA"), ("J1.2", "- 12 V"), ("JP1.1", "jumper on 12V"),
                        ("TP1.1", "meter: black"),
                        ("TP2.1", "11.5 to 11.9 V"), ("TP4.1", "4.9 to 5.1 V"))),
    AssemblyStep(title="flash both modules", parts=r"U[12]|SW1", is_soldering=False,
                 notes=(("U2.IO6", "USB cable: flash the ESP32"), ("SW1.1", "held while RESET is pressed: download"),
                        ("U1.3V3", "SWD header at this end: ST-Link"))),
    AssemblyStep(title="self-test: no robot, no cable at J3", parts=r"U1|J3|J7", is_soldering=False,
                 notes=(("U1.PA9", "PA9: RX of a 3.3 V USB adapter"), ("U1.PA10", "PA10: its TX"),
                        ("U1.GND", "its GND"),
                        ("J3.2", "join 2 and 3"), ("J7.1", "jumper on"), ("U2.IO6", "USB cable: console"))),
    AssemblyStep(title="robot, supply and emergency stop", parts=r"J[1237]", is_soldering=False,
                 notes=(("J3.3", "straight cable to the HOST socket"), ("J1.1", "battery, 11 to 14.8 V: +"),
                        ("J1.2", "battery: -"),
                        ("J2.1", "or a 5 V bank, JP1 on BANK"), ("J7.1", "emergency stop: a contact that opens,"),
                        ("J7.2", "instead of the jumper"))),
)  # fmt: skip

_STYLE = (
    ".edge{fill:#eef3ec;stroke:#3d5a3d;stroke-width:.3} .body{fill:#dfe5de} .on{fill:#ff9d2e} .pad{fill:#8f6f12}"
    " .line{stroke:#d62f2f;stroke-width:.25;fill:none} .end{fill:#d62f2f} text{font:2.4px sans-serif;fill:#25303c}"
    " .ref{font-size:1.7px;text-anchor:middle;fill:#1c4f9c}"
)
#: Room for words beside the board, and a line of them.
MARGIN_MM, LINE_MM = 62.0, 4.2


def pictures(design: BoardDesign) -> dict[str, str]:
    """Return every step's picture as SVG, by file name."""
    return {
        f"{design.variant}-step-{number:02}.svg": _picture(design, number, step) for number, step in enumerate(STEPS, 1)
    }


def _picture(design: BoardDesign, number: int, step: AssemblyStep) -> str:
    width, height = rules.BOARD_WIDTH_MM, rules.BOARD_HEIGHT_MM
    places, pads = place(design), placed_pads(design)
    title = html.escape(f"{number}. {step.title}")
    out = [
        (
            f'<svg viewBox="-{MARGIN_MM + 2:g} -8 {width + 2 * MARGIN_MM + 4:g} {height + 10:g}" '
            f'xmlns="http://www.w3.org/2000/svg"><style>{_STYLE}</style>'
        ),
        f'<text x="0" y="-3">{title}</text>',
        f'<rect class="edge" width="{width:g}" height="{height:g}" rx="{rules.CORNER_MM:g}"/>',
    ]
    marked = [part for part in design.components if re.fullmatch(step.parts, part.ref)]
    for part in design.components:
        body = body_mm(part, places[part.ref])
        if body:
            x0, y0, x1, y1 = body
            kind = "on" if part in marked else "body"
            out.append(f'<rect class="{kind}" x="{x0:.2f}" y="{y0:.2f}" width="{x1 - x0:.2f}" height="{y1 - y0:.2f}"/>')
    for part in marked:
        own = [pad for pad in pads if pad.ref == part.ref]
        out += [f'<circle class="pad" cx="{pad.center_mm[0]:.2f}" cy="{pad.center_mm[1]:.2f}" r="0.5"/>' for pad in own]
        x = sum(pad.center_mm[0] for pad in own) / len(own)
        y = sum(pad.center_mm[1] for pad in own) / len(own)
        out.append(f'<text class="ref" x="{x:.2f}" y="{y + 0.6:.2f}">{part.ref}</text>')
    return "\n".join([*out, *_notes(design, step, pads), "</svg>", ""])


def _notes(design: BoardDesign, step: AssemblyStep, pads: list[PlacedPad]) -> Iterator[str]:
    """Yield words at both sides of the board, in the order of their pads from the top, each with its line."""
    found = [(at, words) for name, words in step.notes if (at := _pad_at(design, name, pads)) is not None]
    for is_left in (True, False):
        side = sorted(
            (row for row in found if (row[0][0] < rules.BOARD_WIDTH_MM / 2) == is_left), key=lambda row: row[0][1]
        )
        level = -LINE_MM
        for (x, y), words in side:
            level = max(level + LINE_MM, min(y, rules.BOARD_HEIGHT_MM))
            edge, anchor = (-2.0, "end") if is_left else (rules.BOARD_WIDTH_MM + 2.0, "start")
            yield f'<path class="line" d="M{x:.2f} {y:.2f} L{edge:g} {level:.2f}"/>'
            yield f'<circle class="end" cx="{x:.2f}" cy="{y:.2f}" r="0.7"/>'
            words_x = edge - 1 if is_left else edge + 1
            yield f'<text x="{words_x:g}" y="{level + 0.8:.2f}" text-anchor="{anchor}">{html.escape(words)}</text>'


def _pad_at(design: BoardDesign, name: str, pads: list[PlacedPad]) -> tuple[float, float] | None:
    """Return where a pad is, None where this variant has no such part; KeyError of a pin that the part lacks."""
    ref, pin = name.split(".")
    part = next((one for one in design.components if one.ref == ref), None)
    if part is None:
        return None
    return next(pad.center_mm for pad in pads if pad.ref == ref and pad.pad.number == _number(part, pin))


def _number(part: Component, pin: str) -> str:
    names = {"U1": BLUEPILL_PINS, "U2": ESP32_PINS}.get(part.ref, ())
    return str(names.index(pin) + 1) if pin in names else pin
