"""Write the drawings of docs/concepts, boxes and arrows, as SVG into docs/pictures/concepts.

What a drawing counts (wires, bit/s, a step of time) is read from the code. A test holds the committed files to this.
Usage: python -m tools.generators.drawings
"""

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path

from adapter_sim.pinout import load_pinout
from p2os.protocol.bauds import DEFAULT_BAUD

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "concepts"
#: Pixels: a column and a row of the grid that boxes stand on, and a box.
COLUMN, ROW, WIDTH, HEIGHT = 200, 108, 150, 64
MARGIN = 24
#: Fill and rim of a kind of box.
FILLS = {"yours": ("#fff3d6", "#b7791f"), "part": ("#e3effb", "#2b6cb0"), "result": ("#e2f4e6", "#2f855a")}


@dataclass(frozen=True, slots=True)
class Box:
    """A box on the grid: its lines, the first of them in bold."""

    column: float
    row: float
    lines: tuple[str, ...]
    kind: str = "part"

    @property
    def middle(self) -> tuple[float, float]:
        """Its middle, in pixels."""
        return MARGIN + self.column * COLUMN + WIDTH / 2, MARGIN + self.row * ROW + HEIGHT / 2


@dataclass(frozen=True, slots=True)
class Arrow:
    """An arrow from one box to another; both ways where it says so."""

    first: str
    second: str
    text: str = ""
    is_both_ways: bool = False


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawing: boxes by name, and the arrows between them."""

    title: str
    boxes: dict[str, Box]
    arrows: tuple[Arrow, ...]


def drawings() -> dict[str, Drawing]:
    """Return every drawing by the name of its file."""
    wires = len(load_pinout().wires)
    chain = Drawing(
        "From your binary to the wheels",
        {
            "binary": Box(0, 0, ("your binary", "ELF, HEX or BIN"), "yours"),
            "board": Box(0, 1, ("BluePill", "emulated STM32F103")),
            "adapter": Box(1, 1, ("adapter", "pins to velocities")),
            "robot": Box(2, 1, ("Pioneer", "its controller")),
            "body": Box(3, 1, ("body and world", "wheels, sonar, walls")),
            "real": Box(2, 2, ("a real Pioneer", "--port serial:…"), "yours"),
        },
        (
            Arrow("binary", "board", "boots"),
            Arrow("board", "adapter", f"{wires} wires", is_both_ways=True),
            Arrow("adapter", "robot", "P2OS", is_both_ways=True),
            Arrow("robot", "body", "speeds", is_both_ways=True),
            Arrow("adapter", "real", f"{DEFAULT_BAUD} bit/s", is_both_ways=True),
        ),
    )
    time = Drawing(
        "One clock that is counted, not read",
        {
            "queue": Box(1, 0, ("virtual time", "nanoseconds, an integer")),
            "board": Box(0, 1, ("board", "advance to t")),
            "adapter": Box(1, 1, ("adapter", "advance to t")),
            "robot": Box(2, 1, ("robot and body", "advance to t")),
            "trace": Box(1, 2, ("trace", "every event with its t"), "result"),
            "hash": Box(2, 2, ("hash", "same input, same hash"), "result"),
        },
        (
            Arrow("queue", "board"), Arrow("queue", "adapter", "next event"), Arrow("queue", "robot"),
            Arrow("board", "trace"), Arrow("adapter", "trace"), Arrow("robot", "trace"), Arrow("trace", "hash"),
        ),
    )  # fmt: skip
    verdict = Drawing(
        "From a scenario to a verdict",
        {
            "scenario": Box(0, 0, ("scenario", "world, goals, faults"), "yours"),
            "binary": Box(0, 1, ("binary", "the one that you flash"), "yours"),
            "seed": Box(0, 2, ("seed", "every random draw"), "yours"),
            "run": Box(1, 1, ("run", "p2os run")),
            "goals": Box(2, 0, ("goals", "judged as it goes")),
            "folder": Box(2, 2, ("run folder", "trace, VCD, report"), "result"),
            "verdict": Box(3, 0, ("verdict", "exit code 0 or 1"), "result"),
            "replay": Box(3, 2, ("replay line", "the same run again"), "result"),
        },
        (
            Arrow("scenario", "run"), Arrow("binary", "run"), Arrow("seed", "run"), Arrow("run", "goals"),
            Arrow("run", "folder"), Arrow("goals", "verdict"), Arrow("folder", "replay"),
        ),
    )  # fmt: skip
    return {"chain": chain, "time": time, "verdict": verdict}


def svg(drawing: Drawing) -> str:
    """Return a drawing as SVG."""
    columns = max(box.column for box in drawing.boxes.values())
    rows = max(box.row for box in drawing.boxes.values())
    width, height = columns * COLUMN + WIDTH + 2 * MARGIN, rows * ROW + HEIGHT + 2 * MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}"',
        f'  height="{height:g}" role="img" font-family="system-ui, sans-serif" text-anchor="middle">',
        f"<title>{escape(drawing.title)}</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8"',
        '  orient="auto-start-reverse"><path d="M0 0 8 4 0 8Z" fill="#4a5568"/></marker></defs>',
        f'<rect width="{width:g}" height="{height:g}" rx="10" fill="#ffffff"/>',
        *(line for arrow in drawing.arrows for line in _arrow(arrow, drawing.boxes)),
        *(line for box in drawing.boxes.values() for line in _box(box)),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _box(box: Box) -> Iterator[str]:
    fill, rim = FILLS[box.kind]
    x, y = box.middle
    yield (f'<rect x="{x - WIDTH / 2:g}" y="{y - HEIGHT / 2:g}" width="{WIDTH}" height="{HEIGHT}" rx="8" '
           f'fill="{fill}" stroke="{rim}" stroke-width="1.5"/>')  # fmt: skip
    for number, line in enumerate(box.lines):
        style = 'font-size="15" font-weight="600"' if number == 0 else 'font-size="12" fill="#4a5568"'
        yield f'<text x="{x:g}" y="{y - 4 + 20 * number:g}" {style}>{escape(line)}</text>'


def _arrow(arrow: Arrow, boxes: dict[str, Box]) -> Iterator[str]:
    (x1, y1), (x2, y2) = boxes[arrow.first].middle, boxes[arrow.second].middle
    ends = _edge(x1, y1, x2, y2), _edge(x2, y2, x1, y1)
    (a, b), (c, d) = ends
    start = ' marker-start="url(#tip)"' if arrow.is_both_ways else ""
    yield (f'<line x1="{a:.1f}" y1="{b:.1f}" x2="{c:.1f}" y2="{d:.1f}" stroke="#4a5568" stroke-width="1.5" '
           f'marker-end="url(#tip)"{start}/>')  # fmt: skip
    if arrow.text:
        is_upright = abs(x1 - x2) < COLUMN / 2
        x, y = (a + c) / 2, (b + d) / 2
        where = f'x="{x + 8:g}" y="{y + 4:g}" text-anchor="start"' if is_upright else f'x="{x:g}" y="{y - 8:g}"'
        yield f'<text {where} font-size="11" fill="#4a5568">{escape(arrow.text)}</text>'


def _edge(x1: float, y1: float, x2: float, y2: float) -> tuple[float, float]:
    """Return where the line from a box's middle to another point leaves the box."""
    dx, dy = x2 - x1, y2 - y1
    share = min(WIDTH / 2 / abs(dx) if dx else 9.0, HEIGHT / 2 / abs(dy) if dy else 9.0)
    return x1 + dx * share, y1 + dy * share


def main() -> None:
    """Write the files."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, drawing in drawings().items():
        (FOLDER / f"{name}.svg").write_text(svg(drawing), encoding="utf-8")


if __name__ == "__main__":
    main()
