"""A campaign file: which scenario, what varies, what must hold, how much may be spent, and who searches.

    scenario = "dodge"                  # a name, or a file beside this one
    search = "sobol"

    [budget]
    runs = 200

    [vary]
    start.heading_deg = { from = 0, to = 350, step = 10 }
    threshold_m = [0.5, 0.6]

    [[draw]]
    kind = "post"
    count = { from = 0, to = 4 }

Every key that `--set` takes can vary. docs/campaigns.md has all keys.
Invariant: a `Campaign` that exists can be begun: its scenario is there and can be run, and every range is one.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal, cast

from p2os.errors import ScenarioError
from p2os.pioneer.world import load_world
from p2os.toml_file import TomlSource, is_file, read_toml, read_user_text
from p2os.toml_record import Record, keys_of, number_of, read, sections, tables_of
from p2os.toml_schema import LONGEST_S, Key, Table, TablePlace, Where, check_table, placed, within
from robot_bench.campaign.reaching.corpus import BEGUN, Coordinates, read_corpus
from robot_bench.campaign.reaching.reach import ToReach, ToReachTable, looked_for
from robot_bench.campaign.reaching.source import reach_of
from robot_bench.campaign.search import SEARCHES
from robot_bench.campaign.things import KINDS
from robot_bench.campaign.trial import Trial, trial_of, unpacked
from robot_bench.events.codec import Json
from robot_bench.scenario.included_files import Setting
from robot_bench.scenario.json_schema import DRAFT, table_schema, with_properties
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.sweep import MOST_RUNS
from robot_bench.scenario.tables import GOALS
from simbase.errors import UsageError, nearest, shown
from simbase.files import VersionedFormat
from simbase.trust import Trust

CAMPAIGN = VersionedFormat("a campaign")
#: chosen: of a drawn place, how far from the start's middle it is free: the hull turns within 0.32 m.
FREE_M = 0.45
#: chosen: a robot of 0.38 m passes with room on both sides.
GAP_M = 0.9


class SpanTable(Record):
    """A range of numbers."""

    from_: Annotated[int | float, Key(kind="number", doc="the least")]
    to: Annotated[int | float, Key(kind="number", doc="the greatest")]
    step: Annotated[int | float | None, Key(kind="number", above=0, doc="from one value to the next")] = None
    tail: Annotated[Literal["even", "long"], Key(
        doc="`long`: twice the value (above 0) is a quarter as frequent, for what costs as much as it is long"
    )] = "even"  # fmt: skip


class DrawTable(Record):
    """`[[draw]]`: things of a kind; numbers may be ranges. The measures of the kinds are keys too."""

    kind: Annotated[str, Key(choices=tuple(KINDS), doc="of thing")]
    name: Annotated[str | None, Key(doc="tells two of a kind apart")] = None
    count: Annotated[int | None, Key(least=0, most=64, doc="how many")] = None
    area_m: Annotated[tuple[float, ...] | None, Key(doc="`[least x, least y, greatest x, greatest y]`")] = None
    heading_deg: Annotated[float | None, Key(least=-36_000, most=36_000, doc="counter-clockwise")] = None
    ahead_m: Annotated[float | None, Key(least=-1000, most=1000, doc="of the robot at its start")] = None
    aside_m: Annotated[float | None, Key(least=-1000, most=1000, doc="to the left of the robot at its start")] = None
    gap_m: Annotated[float | None, Key(least=0, most=100, doc="from other things; default the file's")] = None


class DisturbTable(Record):
    """`[[disturb]]`: a fault; its times may be ranges."""

    fault: Annotated[str, Key(doc="its words")]
    at_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="when")] = 0.0
    for_s: Annotated[float | None, Key(above=0, most=LONGEST_S, doc="it ends after so long")] = None
    share: Annotated[float, Key(above=0, most=1, doc="in so many of the runs it happens")] = 1.0
    name: Annotated[str | None, Key(doc="what goals are `excused_by`; else the first word of the fault")] = None


DRAW = (
    *keys_of(DrawTable),
    *(
        Key(name=name, kind="number", above=0, most=1000)
        for name in sorted({name for kind in KINDS.values() for name in kind.measures})
    ),
)
#: What the runs that propose set, and those that confirm, where the file says nothing.
CHEAP: Table = {"body": "kinematic"}
FULL: Table = {}


@dataclass(frozen=True, slots=True)
class Span:
    """What a parameter may be: a range of numbers, or some values; a range of one is a value."""

    low: float = 0.0
    high: float = 0.0
    #: 0: any number between.
    step: float = 0.0
    is_whole: bool = False
    #: In place of a range.
    choices: tuple[object, ...] = ()
    #: Whether values are as often as they are small (bounded Pareto, exponent 1), in place of evenly.
    is_long_tailed: bool = False

    @property
    def count(self) -> int:
        """How many values there are; 0 where they are too many to count."""
        if self.choices:
            return len(self.choices)
        if self.low == self.high:
            return 1
        return int((self.high - self.low) / self.step + 1e-9) + 1 if self.step else 0

    def value(self, at: float) -> object:
        """Return the value at a place of the unit interval, 0 up to but not 1."""
        if self.choices:
            return self.choices[min(int(at * len(self.choices)), len(self.choices) - 1)]
        if self.is_long_tailed:
            at = (self.low / (1 - at * (1 - self.low / self.high)) - self.low) / (self.high - self.low)
        if self.step:
            found = self.low + min(int(at * self.count), self.count - 1) * self.step
        else:
            found = self.low + at * (self.high - self.low)
        return round(found) if self.is_whole else round(found, 4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A `[[draw]]` table: things of a kind, each with numbers of its own."""

    name: str
    kind: str
    count: Span
    #: Least x, least y, greatest x and y, metres; None: the floor of the world.
    area_m: tuple[float, float, float, float] | None
    #: Of a thing that is placed as seen from the robot at its start: ahead of it and to its left; None: in the area.
    seen: tuple[Span, Span] | None
    #: In the world; of a thing seen from the robot 0 turns its opening, its length or its way towards the robot.
    heading_deg: Span
    measures: Mapping[str, Span]
    #: How far off other things at least, in place of the campaign's.
    gap_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """A `[[disturb]]` table: a fault whose words and times have numbers that are drawn."""

    words: str
    at_s: Span
    for_s: Span | None
    #: In so many of the runs it happens.
    share: float
    #: Name in braces in the words → its values.
    values: Mapping[str, Span]
    #: What goals are excused by.
    name: str = ""

    def table(self, value: Callable[[str, Span], object]) -> Table:
        """Return the `[[fault]]` table of a run; `value` chooses from the span of each key."""
        words = self.words
        for key, span in self.values.items():
            words = words.replace(f"{{{key}}}", str(value(key, span)))
        times = {"at_s": self.at_s} | ({} if self.for_s is None else {"for_s": self.for_s})
        return {"fault": words} | {key: value(key, span) for key, span in times.items()}


class Budget(Record):
    """`[budget]`: how much may be spent; None: without end."""

    runs: Annotated[int, Key(least=1, most=MOST_RUNS, doc="that propose")] = 200
    confirmations: Annotated[int, Key(least=0, most=MOST_RUNS, doc="runs in full")] = 20
    minutes: Annotated[float | None, Key(above=0, most=LONGEST_S, doc="of the clock")] = None
    virtual_hours: Annotated[float | None, Key(above=0, most=LONGEST_S, doc="of virtual time")] = None


class RunLimits(Record):
    """`[limits]`: what one run may take; more is an error of that run."""

    cpu_s: Annotated[float, Key(least=1, most=LONGEST_S, doc="of the processor")] = 300.0
    memory_mb: Annotated[int, Key(least=64, most=1_000_000, doc="of memory")] = 2000


class CampaignTable(Record):
    """The top of the file."""

    version: Annotated[int, Key(least=1, most=CAMPAIGN.newest, doc="of these keys")] = CAMPAIGN.newest
    description: Annotated[str, Key(doc="one sentence")] = ""
    scenario: Annotated[str, Key(doc="a shipped scenario, or a file beside this one")]
    firmware: Annotated[str | None, Key(doc="a file beside this one; default the scenario's")] = None
    search: Annotated[str, Key(choices=tuple(SEARCHES), doc="[who proposes](campaigns.md#searches)")] = "sobol"
    seed: Annotated[int, Key(least=0, most=2**31 - 1, doc="of the search, not of the runs")] = 0
    #: chosen: the set of runs depends on it, not on the workers.
    batch: Annotated[int, Key(least=1, most=1024, doc="points proposed before any result")] = 16
    near_misses: Annotated[int, Key(
        least=0, most=1024, doc="passed points of each batch, least margin first, to run in full with what is left"
    )] = 1  # fmt: skip
    gap_m: Annotated[float, Key(least=0, most=100, doc="between drawn things")] = GAP_M
    free_m: Annotated[float, Key(least=0, most=100, doc="around the robot's middle at its start")] = FREE_M
    swarm: Annotated[float, Key(
        least=0, most=0.9, doc="part of the [features](campaigns.md#swarm) that each point turns off"
    )] = 0.0  # fmt: skip
    corpus: Annotated[str | None, Key(
        doc="a file of [points](campaigns.md#reached-and-not) for the next campaign; it need not exist"
    )] = None  # fmt: skip
    budget: Annotated[Budget, Key(doc="of the campaign")] = field(default_factory=Budget)
    limits: Annotated[RunLimits, Key(doc="of one run; one above them has no verdict")] = field(
        default_factory=RunLimits
    )
    cheap: Annotated[Mapping[str, object] | None, Key(
        doc='settings of the proposing runs, any key of a scenario; default `body = "kinematic"`'
    )] = None  # fmt: skip
    full: Annotated[Mapping[str, object] | None, Key(doc="settings of the confirming runs; default the scenario's")] = (
        None
    )
    vary: Annotated[Mapping[str, object] | None, Key(
        doc="each key of [`--set`](scenarios.md#files-of-files), with its values"
    )] = None  # fmt: skip
    draw: Annotated[
        tuple[Table, ...], Key(record=DrawTable, doc="[things](campaigns.md#things-that-are-drawn) in the way")
    ] = ()
    disturb: Annotated[
        tuple[Table, ...], Key(record=DisturbTable, doc="[faults](campaigns.md#faults-that-are-drawn)")
    ] = ()
    reach: Annotated[
        tuple[Table, ...],
        Key(record=ToReachTable, doc="what one point at least [has to reach](campaigns.md#reached-and-not)"),
    ] = ()
    goal: Annotated[tuple[Table, ...], GOALS] = ()
    keeps: Annotated[tuple[str, ...], Key(
        kind="list", doc="kinds of the scenario's goals to keep beside the file's; a run that misses one ends"
    )] = ()  # fmt: skip


#: Every table of a campaign file and its keys.
TABLES: Mapping[str, tuple[Key, ...]] = {**dict(sections(CampaignTable)), "[[draw]]": DRAW}


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Everything that a campaign needs to know."""

    name: str
    description: str
    #: The file's own text.
    text: str
    #: The scenario, with the campaign's goals where it has any.
    trial: Trial
    search: str
    seed: int
    batch: int
    near_misses: int
    gap_m: float
    free_m: float
    budget: Budget
    limits: RunLimits
    cheap: tuple[Setting, ...] = ()
    full: tuple[Setting, ...] = ()
    vary: Mapping[str, Span] = field(default_factory=dict)
    draws: tuple[Drawn, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()
    #: What share of its features a point turns off; 0: none is ever turned off.
    swarm: float = 0.0
    reaches: tuple[ToReach, ...] = ()
    #: Where points are kept that reached something new, for the campaigns to come; and those that this one begins with.
    corpus_file: Path | None = None
    corpus: tuple[Coordinates, ...] = ()


def load_campaign(path: Path, *, trust: bool | Trust = False) -> Campaign:
    """Read and check a campaign file.

    Args:
        path: The file.
        trust: Whether code that its scenario names may be executed (docs/trust.md).

    Raises:
        ScenarioError: It cannot be read, breaks the schema, or its scenario does.
    """
    text = read_user_text(path, "a campaign", ScenarioError, hint="p2os campaign new SCENARIO writes one")
    return parse_campaign(text, path, trust=trust)


def parse_campaign(text: str, path: Path, *, firmware: Path | None = None, trust: bool | Trust = False) -> Campaign:
    """Check the text of a campaign file, whose program `firmware` may replace; errors as of `load_campaign`."""
    table, places = read_toml(text, path.name, CAMPAIGN, ScenarioError)
    where = TablePlace(TomlSource(path.name, places))
    top = read(CampaignTable, table, where)
    trial = _with_start(_trial(top, path, where, firmware, trust), top.vary or {}, path)
    draws = _draws(top.draw, where)
    disturbances = tuple(_disturbance(row, within(where, "disturb", n)) for n, row in enumerate(top.disturb))
    vary = {key: _span(value, at) for key, value, at in _leaves(top.vary or {}, "", within(where, "vary"))}
    cheap, full = (
        tuple((key, value) for key, value, _ in _leaves({**defaults, **(said or {})}, "", where))
        for said, defaults in ((top.cheap, CHEAP), (top.full, FULL))
    )
    mode = dict(cheap).get("mode", trial.table.get("mode"))
    if disturbances and mode == "direct":
        raise ScenarioError(
            f"{within(where, 'disturb', 0)}: a fault acts on the robot's controller, and mode direct has none",
            hint='[cheap] mode = "adapter"',
        )
    if not vary and not draws and not disturbances:
        raise ScenarioError(f"{where}: nothing varies", hint="[vary], [[draw]] or [[disturb]]")
    reaches = tuple(
        reach_of(read(ToReachTable, row, within(where, "reach", n)), trial) for n, row in enumerate(top.reach)
    )
    trial = replace(trial, looks_for=looked_for(reaches))
    corpus_file = None if top.corpus is None else path.parent / top.corpus
    begun = path.parent / BEGUN
    found = Campaign(
        swarm=top.swarm, reaches=reaches, corpus_file=corpus_file,
        corpus=() if corpus_file is None else read_corpus(begun if is_file(begun) else corpus_file),
        name=path.stem, description=top.description, text=text, trial=trial, search=top.search, seed=top.seed,
        batch=top.batch, near_misses=top.near_misses, gap_m=top.gap_m, free_m=top.free_m, budget=top.budget,
        limits=top.limits, cheap=cheap, full=full, vary=vary, draws=draws, disturbances=disturbances,
    )  # fmt: skip
    _refuse_settings(found, path)
    _refuse_excuses(top.goal, [*(one.name for one in draws), *(one.name for one in disturbances)], where)
    for number, one in enumerate(disturbances):
        faults = [one.table(lambda _, span: span.value(0.0)), one.table(lambda _, span: span.value(1.0))]
        _scenario(trial.set(*cheap).with_lists(fault=faults), str(within(where, "disturb", number)))
    return found


def campaign_schema() -> Json:
    """Return the JSON schema of a campaign file, made of the keys that the loader checks by."""
    spans: Json = {
        "oneOf": [{"type": ["number", "string", "boolean"]}, {"type": "array"}, table_schema(keys_of(SpanTable))]
    }
    draw = with_properties(table_schema(DRAW), dict.fromkeys(_SPANNED, spans))
    disturb = with_properties(table_schema(keys_of(DisturbTable)), {"at_s": spans, "for_s": spans})
    disturb["additionalProperties"] = spans
    own: Json = {"draw": {"type": "array", "items": draw}, "disturb": {"type": "array", "items": disturb}}
    top = with_properties(table_schema(keys_of(CampaignTable)), own)
    return {"$schema": DRAFT, "title": "A campaign of p2os", **top}


def _trial(top: CampaignTable, path: Path, where: TablePlace, firmware: Path | None, trust: bool | Trust) -> Trial:
    beside = path.parent / top.scenario
    if firmware is None and top.firmware is not None:
        firmware = path.parent / top.firmware
        if not is_file(firmware):
            raise ScenarioError(f"{where.at('firmware')}: there is no file {shown(top.firmware)} beside it")
    with placed(where, "scenario"):
        trial = trial_of(str(beside) if is_file(beside) else top.scenario, firmware=firmware, trust=trust)
    own = tables_of(trial.table, "goal")
    for kind in top.keeps:
        if kind not in {goal["kind"] for goal in own}:
            raise ScenarioError(f"{where.at('keeps')}: the scenario has no goal {shown(kind)}", hint="leave it out")
    kept = [{"ends_run": "missed", **goal} for goal in own if goal["kind"] in top.keeps]
    return trial.with_lists(goal=[*kept, *top.goal]) if top.goal else trial


def _with_start(trial: Trial, vary: Table, path: Path) -> Trial:
    """Return a trial of which a part of the start can vary: the rest is then the world's own."""
    if "start" not in vary or "start" in trial.table or isinstance(trial.table.get("robot"), list):
        return trial
    scenario = _scenario(trial, path.name)
    start = load_world(scenario.world, seed=scenario.seed).start
    heading_deg = round(math.degrees(start.heading_rad), 4)
    return trial.set(("start", {"x_m": start.x_m, "y_m": start.y_m, "heading_deg": heading_deg}))


def _refuse_settings(campaign: Campaign, path: Path) -> None:
    """Refuse goals, stages and varied keys that the scenario cannot have: it is built with the middle of each range.

    Raises:
        ScenarioError: So it is.
    """
    middle = [(key, span.value(0.5)) for key, span in campaign.vary.items()]
    for stage, settings in (("cheap", campaign.cheap), ("full", campaign.full)):
        where = f"{path.name}: [{stage}]"
        try:
            trial = campaign.trial.set(*settings, *middle)
        except UsageError as error:
            raise ScenarioError(f"{where} {error}".replace("--set ", ""), hint=error.hint) from error
        _scenario(trial, where)


def _refuse_excuses(goals: Sequence[Table], names: Sequence[str], where: TablePlace) -> None:
    """Refuse goals that are excused by what nobody draws or disturbs by."""
    for number, goal in enumerate(goals):
        for name in cast("Sequence[str]", goal.get("excused_by", ())):
            if name not in names:
                at = within(where, "goal", number)
                raise ScenarioError(
                    f"{at}: there is no [[draw]] or [[disturb]] {shown(name)}", hint=nearest(name, names)
                )


def _scenario(trial: Trial, where: str) -> Scenario:
    """Return the scenario of a trial; its files need not be there any more when it is used.

    Raises:
        ScenarioError: It cannot be; the message has `where` before it.
    """
    with placed(where), unpacked(trial.files) as folder:
        return trial.scenario(folder)


def _leaves(table: Table, above: str, where: Where) -> Iterator[tuple[str, object, str]]:
    """Yield each key of nested tables with its value and its place; what has `from` is a value."""
    for name, value in table.items():
        key = f"{above}.{name}".removeprefix(".")
        if isinstance(value, Mapping) and "from" not in value:
            yield from _leaves(value, key, where)
        else:
            at = where if isinstance(where, str) else where.at(key)
            yield key, value, f"{at}: {key}"


def _draws(tables: Sequence[Table], where: TablePlace) -> tuple[Drawn, ...]:
    found: list[Drawn] = []
    for number, table in enumerate(tables):
        place = within(where, "draw", number)
        for end in (0.0, 1.0):
            plain = {
                key: _span(value, f"{place}: {key}").value(end) if key in _SPANNED else value
                for key, value in table.items()
            }
            check_table(plain, DRAW, place)
        kind = str(table["kind"])
        spans = {key: _span(value, f"{place}: {key}") for key, value in table.items() if key in _SPANNED}
        known = KINDS[kind].measures
        strange = next((key for key in spans if key not in {*known, *_PLACING}), None)
        if strange is not None:
            raise ScenarioError(f"{place}: a {kind} has no {strange}", hint=nearest(strange, list(known)))
        name = str(table.get("name", kind))
        if name in [one.name for one in found]:
            raise ScenarioError(f"{place}: there is another {shown(name)}", hint='name = "…" tells them apart')
        ahead, aside = spans.pop("ahead_m", None), spans.pop("aside_m", Span(0.0, 0.0))
        if ahead is None and "aside_m" in table:
            raise ScenarioError(f"{place}: aside_m without ahead_m", hint="ahead_m = { from = 0.8, to = 2.0 }")
        if ahead is not None and "area_m" in table:
            raise ScenarioError(f"{place}: area_m beside ahead_m", hint="leave one of the two out")
        found.append(Drawn(
            seen=None if ahead is None else (ahead, aside),
            name=name, kind=kind, count=spans.pop("count", Span(1, 1, is_whole=True)),
            area_m=_area(table.get("area_m"), place), gap_m=number_of(table, "gap_m") if "gap_m" in table else None,
            heading_deg=spans.pop("heading_deg", Span(0.0, 360.0) if ahead is None else Span(-30.0, 30.0)),
            measures={key: spans.get(key, Span(low, high)) for key, (low, high) in known.items()},
        ))  # fmt: skip
    return tuple(found)


#: Keys of `[[draw]]` that take a range.
_PLACING = frozenset({"count", "heading_deg", "ahead_m", "aside_m"})
_SPANNED = frozenset(key.name for key in DRAW if key.kind in {"number", "whole"} and key.name != "gap_m")


def _disturbance(table: Table, where: Where) -> Disturbance:
    named = {key: value for key, value in table.items() if f"{{{key}}}" in str(table.get("fault", ""))}
    plain = {
        key: _span(value, f"{where}: {key}").value(0.5) if key in {"at_s", "for_s"} else value
        for key, value in table.items() if key not in named
    }  # fmt: skip
    check_table(plain, keys_of(DisturbTable), where)
    return Disturbance(
        words=str(table["fault"]), at_s=_span(table.get("at_s", 0.0), f"{where}: at_s"),
        for_s=_span(table["for_s"], f"{where}: for_s") if "for_s" in table else None,
        share=number_of(table, "share", 1.0),
        values={key: _span(value, f"{where}: {key}") for key, value in named.items()},
        name=str(table.get("name") or (str(table["fault"]).split() or [""])[0]),
    )  # fmt: skip


def _area(value: object, where: Where) -> tuple[float, float, float, float] | None:
    if value is None:
        return None
    numbers = [float(item) for item in cast("Sequence[object]", value) if isinstance(item, (int, float))]
    if len(numbers) != 4 or numbers[0] >= numbers[2] or numbers[1] >= numbers[3]:
        raise ScenarioError(f"{where}: area_m must be [least x, least y, greatest x, greatest y]")
    return numbers[0], numbers[1], numbers[2], numbers[3]


def _span(value: object, where: str) -> Span:
    if isinstance(value, list):
        if not value or any(isinstance(item, (dict, list)) for item in value):
            raise ScenarioError(f"{where} = {shown(value)} is no list of values", hint="[0.4, 0.6]")
        return Span(choices=tuple(value))
    if isinstance(value, Mapping):
        span = read(SpanTable, value, where)
        if not span.from_ <= span.to:
            raise ScenarioError(f"{where}: to is below from", hint="{ from = 0.1, to = 0.5 }")
        is_long = span.tail == "long"
        if is_long and not 0 < span.from_ < span.to:
            raise ScenarioError(
                f"{where}: a long tail has to begin above 0", hint='{ from = 60, to = 900, tail = "long" }'
            )
        is_whole = all(isinstance(item, int) for item in value.values() if not isinstance(item, str))
        step = float((1 if is_whole else 0) if span.step is None else span.step)
        return Span(span.from_, span.to, step, is_whole, is_long_tailed=is_long)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return Span(value, value, is_whole=isinstance(value, int))
    return Span(choices=(value,))
