"""What a recording is, beside its rows: title, verdict, channels, world, robots, and the parts of a report.

It goes to the page as JSON, whose types in TypeScript are made of these classes (`tools/generators/page_types.py`).

Invariant: every text is shown as text, whoever wrote it.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal, TypeAlias

from p2os.view.channels import FORMAT
from p2os.view.run_control import RunState
from simbase.timing import Nanos

#: How something came out: a run, a goal, a row.
Standing: TypeAlias = Literal["", "passed", "failed", "open"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPlace:
    """Where a range sensor sits on its robot."""

    name: str
    x_m: float
    y_m: float
    #: Counter-clockwise from ahead.
    bearing_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StateTransition:
    """From one state to another, as places in `states`, and what leads there."""

    source: int
    target: int
    cause: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelHeader:
    """A channel: what its rows are of."""

    name: str
    #: Name of a kind (`channels`).
    kind: str
    #: In frames; given by the recording that it is added to.
    id: int = -1
    #: Of numbers; empty: none.
    unit: str = ""
    #: What it is shown with: `pins: motor 1`, `wheels`.
    group: str = ""
    #: Who it comes from: a robot's name; empty: the only one.
    source: str = ""
    #: One line about it.
    doc: str = ""
    #: Another channel that it belongs to; -1: none.
    of: int = -1
    #: Bits of `levels`; sensors of `ranges`.
    width: int = 1
    #: Of `samples`: whether a value holds until the next one, or goes to it in a straight line.
    is_stepped: bool = False
    #: Of `samples`: a line drawn across, such as a threshold; absent: None.
    mark: float | None = None
    #: Of `ranges`.
    sensors: Sequence[SensorPlace] = ()
    #: Opening angle of each of them, radians, and how far they see, metres.
    cone_rad: float = 0.0
    range_m: float = 0.0
    #: Of `state`.
    states: Sequence[str] = ()
    transitions: Sequence[StateTransition] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldThing:
    """A thing of the world, where it stands at the start."""

    name: str
    #: `wall`, `box`, `cylinder`, `floor`, `ramp`, `robot`, … as the world's file has it.
    kind: str
    #: `box` has `length_m` along its heading and `width_m` across; `cylinder` has `radius_m`; `polygon` has `points`.
    shape: Literal["box", "cylinder", "polygon"]
    x_m: float
    y_m: float
    heading_rad: float = 0.0
    #: Of its underside above the floor.
    z_m: float = 0.0
    height_m: float = 0.5
    length_m: float = 0.0
    width_m: float = 0.0
    radius_m: float = 0.0
    #: Corners counter-clockwise, relative to its middle.
    points: Sequence[tuple[float, float]] = ()
    #: Whether it is there at the start.
    is_there: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldHeader:
    """The world."""

    name: str
    #: Least x and y, greatest x and y, metres.
    extent_m: tuple[float, float, float, float]
    things: Sequence[WorldThing] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotHeader:
    """A robot: its outline around the point that its pose says."""

    #: Empty: the only one.
    name: str
    model: str
    front_m: float
    rear_m: float
    width_m: float
    height_m: float = 0.22


@dataclass(frozen=True, slots=True, kw_only=True)
class WordOffer:
    """A word behind the name of a fault: one of `choices`, or a number."""

    name: str
    choices: Sequence[str] = ()
    least: float = 0.0
    most: float = 0.0
    #: 1: whole numbers; 0: any.
    step: float = 0.0
    #: What it is at first.
    usual: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultOffer:
    """A fault that can be injected: `fault NAME WORD …`."""

    name: str
    doc: str
    words: Sequence[WordOffer] = ()
    #: It happens once: there is nothing to clear.
    is_momentary: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class HandsOffer:
    """What hands can do in what is shown, beside moving its things."""

    #: Of several robots the one that it is for; empty: the only one.
    robot: str = ""
    faults: Sequence[FaultOffer] = ()
    #: Of the robot, to be pressed.
    buttons: Sequence[str] = ()
    #: Wires whose level can be held, pins whose volts can, and ports that can be typed into.
    pins: Sequence[str] = ()
    analog_pins: Sequence[str] = ()
    ports: Sequence[str] = ()
    #: How fast the robot is driven by a key that is held or a stick at its end, m/s and deg/s; 0: not at all.
    most_mps: float = 0.0
    most_dps: float = 0.0
    #: A robot that is there: it can be driven and stopped, and nothing else.
    is_real: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PageCell:
    """A cell of a table."""

    text: str
    #: A file beside the page, or none.
    href: str = ""
    standing: Standing = ""
    is_number: bool = False
    #: A time to go to, ns; absent: None.
    at_ns: Nanos | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PageTable:
    """A table; one without `head` has names in its first column."""

    kind: Literal["table"] = "table"
    title: str = ""
    head: Sequence[str] = ()
    rows: Sequence[Sequence[PageCell]] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PageText:
    """A text as it is: a listing where `is_listing`, else a paragraph."""

    kind: Literal["text"] = "text"
    title: str = ""
    text: str = ""
    is_listing: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePicture:
    """A picture: base64 of a PNG."""

    kind: Literal["picture"] = "picture"
    title: str = ""
    alt: str = ""
    png: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageCurve:
    """One of the curves, or rows of points, of a plot."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    #: `bars` stand on 0 and are as wide as the step of `x`.
    style: Literal["line", "step", "points", "bars"] = "line"
    #: Texts of the points, in their order; a point whose `hrefs` is not empty is a link.
    labels: Sequence[str] = ()
    hrefs: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePlot:
    """A plot that is not over the run's time, with ticks and units on both axes."""

    kind: Literal["plot"] = "plot"
    title: str = ""
    x_name: str = ""
    x_unit: str = ""
    y_name: str = ""
    y_unit: str = ""
    curves: Sequence[PageCurve] = ()
    #: Whether a length of one unit is the same along both axes.
    is_equal: bool = False
    #: Values of x at which a line stands, such as a median.
    marks: Sequence[float] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PageList:
    """Lines, each with how it came out."""

    kind: Literal["list"] = "list"
    title: str = ""
    items: Sequence[PageCell] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePlan:
    """A small plan of a world with ways in it: metres."""

    kind: Literal["plan"] = "plan"
    title: str = ""
    #: Under it.
    text: str = ""
    #: A command that makes it again.
    listing: str = ""
    #: The number by which a page that is served opens it; None: it cannot be opened.
    opens: int | None = None
    world: WorldHeader | None = None
    ways: Sequence[PageCurve] = ()
    #: Collisions, and other places with a word each.
    hits: Sequence[tuple[float, float]] = ()
    places: Sequence[tuple[float, float, str]] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureShape:
    """A shape of a drawing; lengths in those of the drawing, y down."""

    #: `box` from its corner, `circle` around its middle with `width` as radius, `text` at its baseline.
    kind: Literal["box", "circle", "text"]
    x: float
    y: float
    width: float = 0.0
    height: float = 0.0
    text: str = ""
    align: Literal["start", "middle", "end"] = "start"
    #: What it stands for, which decides its colour: `board`, `chip`, `metal`, `lit`, `unlit`, `high`, `low`, `wave`,
    #: `floating`, `supply`, `on-board`.
    role: str = ""
    #: Shown of a shape that is pointed at.
    title: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageDrawing:
    """A drawing of shapes."""

    kind: Literal["drawing"] = "drawing"
    title: str = ""
    #: What it shows, in words.
    alt: str = ""
    width: float = 100.0
    height: float = 100.0
    shapes: Sequence[PictureShape] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSource:
    """Lines of a source file, and which of them have run by the page's time."""

    kind: Literal["source"] = "source"
    #: The file.
    title: str = ""
    lines: Sequence[str] = ()
    #: Number of the first of them.
    first: int = 1
    #: When each ran first, ns: 0 where it is not known when, -1: not yet, -2: it has no code.
    ran_ns: Sequence[Nanos] = ()
    #: Numbers of lines with a branch that has run, and always gone the same way.
    one_way: Sequence[int] = ()
    #: Number of the line that comes next; 0: none of these.
    next: int = 0


PageBlock: TypeAlias = PageTable | PageText | PagePicture | PagePlot | PageList | PagePlan | PageDrawing | PageSource


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSection:
    """A titled part of a report."""

    title: str
    note: str = ""
    blocks: Sequence[PageBlock] = ()
    #: Closed until who reads opens it.
    is_folded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelHeader:
    """A panel: a view of what runs, as it is now."""

    name: str
    title: str
    #: What one may look at in it; none: it is one thing.
    choices: Sequence[str] = ()
    #: What it shows of a run that is over; of one that goes on `PanelState` tells.
    sections: Sequence[PageSection] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelState:
    """What a panel shows."""

    name: str
    choice: str
    at_ns: Nanos
    sections: Sequence[PageSection] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PageHeader:
    """What a page begins with."""

    format: int = FORMAT
    title: str
    #: As in summary.json: `passed`, `failed`, …; empty: nothing was judged.
    verdict: str = ""
    standing: Standing = ""
    #: What was run, on what, in what, in a line.
    lead: str = ""
    #: Why it failed, in a line.
    why: str = ""
    start_ns: Nanos = 0
    end_ns: Nanos = 0
    #: More comes.
    is_live: bool = False
    channels: Sequence[ChannelHeader] = ()
    world: WorldHeader | None = None
    robots: Sequence[RobotHeader] = ()
    #: What hands can do; None: nothing.
    hands: HandsOffer | None = None
    #: Of several robots, to each; the first of them is `hands`.
    robot_hands: Sequence[HandsOffer] = ()
    sections: Sequence[PageSection] = ()
    #: Of a run that goes on.
    panels: Sequence[PanelHeader] = ()
    #: A line for each kind of rows of which the page has not all.
    left_out: Sequence[str] = ()
    footer: str = ""

    def as_json(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What a page asks for: rows of channels within a time, as many as its pixels can show."""

    want: Sequence[int] = ()
    from_ns: Nanos = 0
    to_ns: Nanos = 0
    pixels: int = 1000
    #: The answer's frames carry it in the `done` message that follows them.
    id: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Answered:
    """What the server says in a text message, beside the header, which comes first and anew when it changes."""

    header: PageHeader | None = None
    #: All frames of the request with this number were sent.
    done: int | None = None
    #: Frames that a page too slow for a live run did not get, so far.
    lost: int | None = None
    #: Now, of a live run.
    now_ns: Nanos | None = None
    #: What was wrong with a request.
    refused: str | None = None
    #: How a run stands that can be controlled, when that changes; and at first whether this page may.
    run: RunState | None = None
    may_control: bool | None = None
    #: Names of variables, for one that was begun.
    offered: Sequence[str] | None = None
    #: What the panel shows that is looked at, when that changes.
    panel: PanelState | None = None


__all__ = [
    "Answered", "ChannelHeader", "FaultOffer", "HandsOffer", "PageBlock", "PageCell", "PageCurve", "PageDrawing",
    "PageHeader", "PageList", "PagePicture", "PagePlan", "PagePlot", "PageSection", "PageSource", "PageTable",
    "PageText", "PanelHeader", "PanelState", "PictureShape", "RobotHeader", "SensorPlace", "Standing",
    "StateTransition", "Wanted", "WordOffer", "WorldHeader", "WorldThing",
]  # fmt: skip
