"""The picture that `p2os monitor` draws of a robot's state. No line, no clock, no terminal.

`Dashboard` is what is shown, `draw` how. `Canvas` draws dots in a terminal: each
character is a braille pattern of 2 by 4 dots; coordinates are dots from the upper left,
and what lies outside is left out.
"""

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from p2os.cli.links.link_quality import LinkQuality
from p2os.client import Limits, Link, RobotState, SonarEcho
from p2os.protocol.connection import ConnectionStats
from p2os.robots.parameters import RobotParameters

#: Characters of the sonar ring; a character is twice as high as wide.
RING_COLUMNS, RING_ROWS = 52, 24
#: chosen: what a Pioneer sees of a room; echoes beyond are drawn at the rim.
RING_METRES = 3.0
#: chosen: nearer than this a Pioneer 2 cannot turn without touching; nearer than twice as much it should slow down.
NEAR_M = 0.35
BAR_CHARACTERS = 20
#: The motion panel beside the ring; the panels on the left.
PANEL_COLUMNS, WIDE_COLUMNS = 54, 112
#: Every panel needs as many rows.
WIDE_ROWS = 34
#: chosen: below this a ring shows nothing.
LEAST_RING_ROWS = 8
#: chosen: lead batteries of 12 V: full, and where a Pioneer's own warning begins (LowBattery of the manuals).
FULL_V, LOW_V = 13.0, 11.5

#: A point of the robot's frame, in metres → its dot.
Place: TypeAlias = Callable[[float, float], tuple[float, float]]
#: Bit of each dot of a braille character, by (column, row) (Unicode standard, block 2800).
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_BLANK = 0x2800


@dataclass(frozen=True, slots=True, kw_only=True)
class Dashboard:
    """All that is shown."""

    title: str
    link: Link
    state: RobotState | None
    limits: Limits
    parameters: RobotParameters
    stats: ConnectionStats
    quality: LinkQuality
    #: What happened last, the newest at the end.
    news: tuple[str, ...] = ()


def draw(dashboard: Dashboard, columns: int = WIDE_COLUMNS, rows: int = WIDE_ROWS) -> RenderableType:
    """Return the whole dashboard.

    Args:
        dashboard: What is to be seen.
        columns: Width of the terminal.
        rows: Its height. In one that is narrow or low, the ring and some lines have to do; 78 by 24 is enough.
    """
    style = {Link.OPEN: "green", Link.WAITING: "yellow", Link.FAILED: "red"}.get(dashboard.link, "yellow")
    heading = Text.assemble((f" {dashboard.title} ", "bold"), "  ", (dashboard.link.value, style))
    if dashboard.state is None:
        return Group(heading, Text("no packet yet"), news_panel(dashboard.news))
    if columns < WIDE_COLUMNS or rows < WIDE_ROWS:
        lines = [f" {words}" for words in _two_lines(dashboard.state)] + [f" {news}" for news in dashboard.news[-1:]]
        # A heading, two lines, one of news, two of the frame, and none left below: a terminal scrolls at its end.
        ring = ring_panel(dashboard.state, dashboard.parameters, rows=max(LEAST_RING_ROWS, min(RING_ROWS, rows - 7)))
        heading.no_wrap, heading.overflow = True, "ellipsis"
        texts = [Text(words, no_wrap=True, overflow="ellipsis") for words in lines]
        return Group(heading, *texts[:2], ring, *texts[2:])
    ring = ring_panel(dashboard.state, dashboard.parameters)
    left = Group(motion_panel(dashboard.state, dashboard.limits), health_panel(dashboard.state), link_panel(dashboard))
    return Group(heading, Columns([left, ring]), news_panel(dashboard.news))


def line_of(state: RobotState) -> str:
    """Return a state as one line."""
    pose, nearest = state.pose, state.nearest()
    return (
        f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, heading {math.degrees(pose.heading_rad):.1f} deg, "
        f"{state.forward_mps:.3f} m/s, {math.degrees(state.turn_radps):.1f} deg/s, {state.battery_v:.1f} V, "
        + (f"nearest {nearest.range_m:.3f} m" if nearest else "no echo")
        + (", STALLED" if state.is_stalled else "")
    )


def _two_lines(state: RobotState) -> tuple[str, str]:
    """Return a state as two lines that fit a narrow terminal."""
    place, sep, rest = line_of(state).partition(" deg, ")
    return place + sep.rstrip(", "), rest


def motion_panel(state: RobotState, limits: Limits) -> Panel:
    """Return pose and speeds."""
    pose, degrees = state.pose, math.degrees
    table = _table()
    table.add_row("x", f"{pose.x_m:9.3f} m", "")
    table.add_row("y", f"{pose.y_m:9.3f} m", "")
    table.add_row("heading", f"{degrees(math.remainder(pose.heading_rad, 2 * math.pi)):9.1f} deg", "")
    table.add_row("forward", f"{state.forward_mps:9.3f} m/s", bar(state.forward_mps, limits.forward_mps))
    table.add_row("turn", f"{degrees(state.turn_radps):9.1f} deg/s", bar(state.turn_radps, limits.turn_radps))
    return Panel(table, title="motion", width=PANEL_COLUMNS)


def health_panel(state: RobotState) -> Panel:
    """Return battery, motors, stalls and bumpers."""
    table = _table()
    share = (state.battery_v - LOW_V) / (FULL_V - LOW_V)
    style = "green" if share > 0.4 else "yellow" if share > 0 else "bold red"
    table.add_row(
        "battery", f"{state.battery_v:9.1f} V", Text("█" * round(BAR_CHARACTERS * min(max(share, 0), 1)), style)
    )
    motors = {None: "unknown", True: "on", False: "off"}[state.motors_enabled]
    table.add_row("motors", f"{motors:>9}", "moving" if state.is_moving else "standing")
    stalls = [side for side, stalled in (("left", state.stall_left), ("right", state.stall_right)) if stalled]
    table.add_row("stalled", Text(f"{' '.join(stalls) or 'no':>9}", "bold red" if stalls else ""), "")
    bumped = [
        *(f"front {number}" for number in state.front_bumpers),
        *(f"rear {number}" for number in state.rear_bumpers),
    ]
    table.add_row(
        "bumpers", Text(f"{'free' if not bumped else 'hit':>9}", "bold red" if bumped else ""), ", ".join(bumped)
    )
    table.add_row("digital", f"in {state.digital_in:08b}", f"out {state.digital_out:08b}")
    if state.stop_button:
        table.add_row("STOP", Text("  pressed", "bold red"), "")
    return Panel(table, title="health", width=PANEL_COLUMNS)


def link_panel(dashboard: Dashboard) -> Panel:
    """Return how well packets come."""
    table, spread, wire = _table(), dashboard.quality.spread, dashboard.stats.wire
    if spread is not None:
        table.add_row(
            "packets", f"{dashboard.quality.packets:9d}", f"every {spread.mean_ms:.1f} ms ± {spread.deviation_ms:.1f}"
        )
        table.add_row("longest", f"{spread.most_ms:9.1f} ms", f"{dashboard.quality.missed} missed")
    damaged = wire.bad_checksums + wire.bad_counts + wire.stalled
    style = "yellow" if damaged else ""
    table.add_row("damaged", Text(f"{damaged:9d}", style), f"{wire.noise_bytes} bytes of noise")
    return Panel(table, title="link", width=PANEL_COLUMNS)


def ring_panel(state: RobotState, parameters: RobotParameters, rows: int = RING_ROWS) -> Panel:
    """Return the robot from above, forward upwards, and the echoes of its sonar, so many characters high."""
    canvas = Canvas(RING_COLUMNS, rows)
    scale = min(canvas.width, canvas.height) / 2 / RING_METRES
    middle = canvas.width / 2, canvas.height / 2

    def place(x_m: float, y_m: float) -> tuple[float, float]:
        """Return the dot of a point of the robot's frame: x ahead is up, y to the left is left."""
        return middle[0] - y_m * scale, middle[1] - x_m * scale

    for metres in (1.0, 2.0):
        for step in range(60):
            angle = step * math.pi / 30
            canvas.dot(*place(metres * math.cos(angle), metres * math.sin(angle)), "dim")
        canvas.text(*place(metres, 0.12), f"{metres:.0f} m", "dim")
    _draw_robot(canvas, place, parameters, stalled=state.is_stalled)
    for echo in state.sonar:
        _draw_echo(canvas, place, echo)
    nearest = state.nearest()
    subtitle = f"nearest {nearest.range_m:.2f} m (sonar {nearest.number})" if nearest else "no echo"
    lines = [Text.assemble(*runs) for runs in canvas.lines()]
    return Panel(Group(*lines), title="sonar", subtitle=subtitle, width=RING_COLUMNS + 4)


def news_panel(news: Iterable[str]) -> Panel:
    """Return what happened last."""
    return Panel(Text("\n".join(news) or "nothing"), title="events", width=PANEL_COLUMNS + RING_COLUMNS + 5)


def bar(value: float, most: float) -> Text:
    """Return a bar from the middle: to the right for positive values."""
    half = BAR_CHARACTERS // 2
    filled = min(half, round(abs(value) / most * half)) if most > 0 else 0
    left, right = ("█" * filled, "") if value < 0 else ("", "█" * filled)
    return Text(f"{left:>{half}}│{right:<{half}}", "cyan")


class Canvas:
    """Dots, and a style for each character.

    Args:
        columns: Characters across.
        rows: Characters down.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._bits = [[0] * columns for _ in range(rows)]
        self._styles = [[""] * columns for _ in range(rows)]
        self._texts: dict[tuple[int, int], str] = {}

    @property
    def width(self) -> int:
        """Dots across."""
        return self.columns * 2

    @property
    def height(self) -> int:
        """Dots down."""
        return self.rows * 4

    def dot(self, x: float, y: float, style: str = "") -> None:
        """Set a dot; its character takes the style."""
        column, row = round(x) // 2, round(y) // 4
        if 0 <= column < self.columns and 0 <= row < self.rows:
            self._bits[row][column] |= _DOTS[round(x) % 2][round(y) % 4]
            self._styles[row][column] = style or self._styles[row][column]

    def line(self, x0: float, y0: float, x1: float, y1: float, style: str = "") -> None:
        """Set the dots between two points, both included."""
        steps = max(1, round(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            self.dot(x0 + (x1 - x0) * step / steps, y0 + (y1 - y0) * step / steps, style)

    def text(self, x: float, y: float, words: str, style: str = "") -> None:
        """Write words over the dots, beginning at the character that holds a dot."""
        for place, letter in enumerate(words):
            column, row = round(x) // 2 + place, round(y) // 4
            if 0 <= column < self.columns and 0 <= row < self.rows:
                self._texts[column, row] = letter
                self._styles[row][column] = style

    def lines(self) -> list[list[tuple[str, str]]]:
        """Return the rows as runs of (text, style)."""
        return [self._runs(row) for row in range(self.rows)]

    def _runs(self, row: int) -> list[tuple[str, str]]:
        runs: list[tuple[str, str]] = []
        for column in range(self.columns):
            letter = self._texts.get((column, row)) or chr(_BLANK + self._bits[row][column])
            style = self._styles[row][column]
            if runs and runs[-1][1] == style:
                runs[-1] = (runs[-1][0] + letter, style)
            else:
                runs.append((letter, style))
        return runs


def _draw_robot(canvas: Canvas, place: Place, parameters: RobotParameters, *, stalled: bool) -> None:
    style = "bold red" if stalled else "bold"
    front, rear = parameters.front_mm / 1000 or 0.2, -(parameters.rear_mm / 1000 or 0.2)
    half = parameters.width_mm / 2000
    corners = [(front, 0.0), (front * 0.6, half), (rear, half), (rear, -half), (front * 0.6, -half), (front, 0.0)]
    for (x0, y0), (x1, y1) in itertools.pairwise(corners):
        canvas.line(*place(x0, y0), *place(x1, y1), style)


def _draw_echo(canvas: Canvas, place: Place, echo: SonarEcho) -> None:
    """Draw a sonar's echo as a stroke across its direction; what is beyond the picture, as a dot at its rim."""
    distance = math.hypot(echo.x_m, echo.y_m)
    angle = math.atan2(echo.y_m, echo.x_m)
    if not echo.is_echo or distance > RING_METRES:
        canvas.dot(*place((RING_METRES - 0.05) * math.cos(angle), (RING_METRES - 0.05) * math.sin(angle)), "dim")
        return
    style = "bold red" if echo.range_m < NEAR_M else "yellow" if echo.range_m < 2 * NEAR_M else "green"
    width = distance * math.tan(math.radians(7.5))
    across = -math.sin(angle) * width, math.cos(angle) * width
    canvas.line(
        *place(echo.x_m - across[0], echo.y_m - across[1]),
        *place(echo.x_m + across[0], echo.y_m + across[1]),
        style,
    )


def _table() -> Table:
    table = Table.grid(padding=(0, 1))
    table.add_column(width=8, style="dim")
    table.add_column(width=16)
    table.add_column()
    return table
