"""A program as `p2os explain` sees it, without a chip: what it would do is given; and the run that it drove."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

from robot_bench.events.kinds import Pose
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.explain.chain import ChainLink
from robot_bench.report.explain.probing import ANSWER_NS, Codes, InputEffect, SensorResponse
from robot_bench.report.explain.replay import ChipReset, Hold, SourcePlace
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.records import S, motor_pins

DISTANCES = tuple(f"DD{n}" for n in range(1, 9))
#: Where the sensors look, degrees, as the trace has it.
HEADINGS = (90, 50, 30, 10, -10, -30, -50, -90)
ROBOT = {"sonar": [[0.1, 0.0, heading * 0.0174533] for heading in HEADINGS], "sonar_cone_rad": 0.5}
STEP_MPS = 0.0625
AHEAD: Codes = (3, 3)


def poses(*legs: tuple[float, Codes], until_s: float, driven: bool = True, turn_radps: float = 0.0) -> list[Pose]:
    """Poses each 50 ms of wheels that have codes from times on, along x; not driven: the wheels stand."""
    found, x_um = list[Pose](), 0.0
    for n in range(round(until_s * 20) + 1):
        left, right = next(codes for since, codes in reversed(legs) if since <= n / 20) if driven else (0, 0)
        found.append(
            Pose(t=n * S // 20, x=round(x_um), y=0, z=0, heading=round(turn_radps * n * 50_000), pitch=0,
                 left=round(left * STEP_MPS * 1e6), right=round(right * STEP_MPS * 1e6), left_angle=0, right_angle=0,
                 collisions=0)
        )  # fmt: skip
        x_um += (left + right) / 2 * STEP_MPS * 1e6 / 20
    return found


def driven_run(*legs: tuple[float, Codes], until_s: float, on: Mapping[str, float | tuple[float, ...]] | None = None,
               **fields: object) -> RunRecord:  # fmt: skip
    """A run whose motors have codes from times on, and whose sensors' pins toggle at times."""
    pins = motor_pins(*((at, *codes) for at, codes in legs))
    for net in DISTANCES:
        times = (on or {}).get(net, ())
        rises = times if isinstance(times, tuple) else (times,)
        pins[net] = Edges([(0, 0), *((round(at * S), 1 - n % 2) for n, at in enumerate(rises))])
    given: dict[str, object] = {
        "meta": {"robot": ROBOT, "threshold_m": 0.5, "step_mps": STEP_MPS}, "pins": pins, "is_cut": False,
        "poses": poses(*legs, until_s=until_s), "last_ns": round(until_s * S),
    }  # fmt: skip
    return RunRecord(**{**given, **fields})  # type: ignore[arg-type]


@dataclass
class AskedReplay:
    """The replay of its chip."""

    record: RunRecord
    end: int
    exact_until: int
    resets: Sequence[ChipReset] = ()
    writes: SourcePlace | None = field(default_factory=lambda: SourcePlace("main.c:40", "drive"))
    fed: Sequence[tuple[int, SourcePlace]] = ()
    edges: Sequence[tuple[int, str, bool]] = ()
    reads_at: Mapping[str, Sequence[int]] = field(default_factory=dict)
    variables: Sequence[tuple[str, int, int]] = ()
    memory: Sequence[tuple[int, bytes]] = ()
    asked: list[object] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.outputs = tuple(net for net in self.record.pins if net.startswith("motor"))
        self.wires = {net: SimpleNamespace(bluepill=f"P{place}") for place, net in enumerate(self.record.pins)}
        self.board = SimpleNamespace(fault=None)

    def pin(self, net: str) -> str:
        return f"{net} at PA{net[-1]}"

    def writer(self, at: int, port: str) -> SourcePlace | None:
        self.asked.append(("writer", at, port))
        return self.writes

    def level(self, net: str, at: int) -> bool:
        return bool([level for t, level in self.record.pins[net] if t <= at][-1])

    def high_since(self, net: str, at: int) -> int | None:
        rises = [t for t, level in self.record.pins[net] if t <= at and level]
        return rises[-1] if self.level(net, at) else None

    def feeds(self, since: int, until: int) -> list[tuple[int, SourcePlace]]:
        self.asked.append(("feeds", since, until))
        return [each for each in self.fed if since <= each[0] <= until]

    def reads(self, since: int, until: int) -> Mapping[str, list[int]]:
        self.asked.append(("reads", since, until))
        return {line: [t for t in times if since <= t <= until] for line, times in self.reads_at.items()}

    def run(self, since: int, until: int, holds: Sequence[Hold] = (), **words: object) -> SimpleNamespace:
        self.asked.append(("run", since, until, len(holds), {hold.level for hold in holds}, words))
        return SimpleNamespace(edges=list(self.edges), memory=[row for row in self.memory if since <= row[0] <= until])


@dataclass
class AskedProber:
    """What a program would do, by what is asked; what was asked is noted."""

    replay: AskedReplay
    effects: Mapping[int, InputEffect] = field(default_factory=dict)
    answered: Mapping[int, Mapping[str, SensorResponse]] = field(default_factory=dict)
    #: What one sensor alone comes to when it is held for longer.
    later: Mapping[str, SensorResponse] = field(default_factory=dict)
    #: When it takes notice of its sensors: from, to.
    notices: tuple[float, float] = (0.0, 1e3)
    lines: Sequence[tuple[float, float, Mapping[str, int]]] = ()
    #: With all pins low, and with all high.
    codes: tuple[Codes, Codes] = (AHEAD, (0, 0))
    new: Sequence[str] = ()
    unnoticed: Sequence[str] = ()
    sensors: Sequence[str] = DISTANCES

    @property
    def asked(self) -> list[object]:
        return self.replay.asked

    def effect(self, holds: Sequence[Hold], until: int, since: int | None = None) -> InputEffect:
        self.asked.append(("effect", [(one.wire, one.level, one.since, one.until) for one in holds], until, since))
        return self.effects[until]

    def answers(self, at: int, span: int = ANSWER_NS, nets: Sequence[str] = ()) -> Mapping[str, SensorResponse]:
        if span != ANSWER_NS or nets:
            self.asked.append(("answers", at, span, list(nets)))
        found = self.answered.get(at) or next(iter(self.answered.values()))
        return {net: (found if span == ANSWER_NS else self.later)[net] for net in nets or self.sensors}

    def moments(self, until: int, count: int = 5) -> list[int]:
        self.asked.append(("moments", until, count))
        return [*self.answered]

    def takes_notice(self, at: int) -> bool:
        self.asked.append(("takes_notice", at))
        return self.notices[0] * S <= at < self.notices[1] * S

    def ended_noticing(self, at: int) -> int | None:
        self.asked.append(("ended_noticing", at))
        return round(self.notices[1] * S) if self.notices[1] > 0 else None

    def noticed(self, holds: Sequence[Hold], until: int, since: int) -> int | None:
        self.asked.append(("noticed", [(one.wire, one.level, one.since, one.until) for one in holds], until, since))
        return None if holds[0].wire in self.unnoticed else since

    def flip_noticed(self, nets: Sequence[str], at: int) -> int | None:
        return None if nets[0] in self.unnoticed else at

    def lines_run(self, since: int, until: int) -> Mapping[str, int]:
        self.asked.append(("lines_run", since, until))
        return next((found for begin, end, found in self.lines if begin * S <= since < end * S), {})

    def new_lines(self, at: int) -> list[str]:
        self.asked.append(("new_lines", at))
        return [*self.new]

    def last_place(self, at: int) -> SourcePlace:
        self.asked.append(("last_place", at))
        return SourcePlace("main.c:7", "wait", ("main",))

    def held(self, since: int, until: int, *, level: bool) -> list[Hold]:
        return [Hold(wire=net, level=level, since=since, until=until) for net in self.sensors]

    def codes_all(self, at: int, *, level: bool) -> Codes:
        self.asked.append(("codes_all", at, level))
        return self.codes[level]


def answers(
    codes: Mapping[int, Codes], *, base: Codes = AHEAD, other: Codes = (2, 2), answered: int | None = 2,
    otherwise_ns: int = S, unnoticed: Sequence[int] = (),
) -> Mapping[str, SensorResponse]:  # fmt: skip
    """What a program does when one sensor alone sees something, by the sensor's number."""
    return {
        f"DD{n}": SensorResponse(
            at=0, base=base, codes=codes.get(n, other), noticed=None if n in unnoticed else 1, answered=answered,
            otherwise_ns=otherwise_ns,
        )
        for n in range(1, 9)
    }  # fmt: skip


def step_lines(steps: Sequence[ChainLink]) -> list[str]:
    """Steps as lines."""
    return [f"  {step.t} {step.part} [{step.evidence}] {step.says}" for step in steps]
