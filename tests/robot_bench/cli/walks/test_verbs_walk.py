"""The bench's verbs: their options, what they refuse, and what they hand on."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from shutil import rmtree
from types import SimpleNamespace
from typing import Any
from unittest import mock

import typer

from p2os.cli.main import make_app
from p2os.cli.main import run as p2os
from robot_bench.cli import names
from robot_bench.cli import run as run_verb
from robot_bench.cli.needs import NEEDS
from robot_bench.cli.project import existing
from robot_bench.run import RunResult
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from tests.robot_bench.cli.walks.printed import in_folder, printed, result_of
from tests.tools.suite.approved import judge_of, said, tried
from tests.tools.suite.declared import declared_of


def verbs(command: Any, path: str = "p2os") -> Iterator[tuple[str, Any]]:
    callback = getattr(command, "callback", None)
    if getattr(callback, "__module__", "").startswith("robot_bench"):
        yield path, command
    for name, below in getattr(command, "commands", {}).items():
        yield from verbs(below, f"{path} {name}")


def options(_draw: Random) -> Iterator[str]:
    """Go through every option of every verb: its names, default and type."""
    for path, command in verbs(typer.main.get_command(make_app())):
        for one in command.params:
            about = vars(one) | {f"type {key}": value for key, value in vars(getattr(one, "type", command)).items()}
            simple = {
                key: value
                for key, value in about.items()
                if isinstance(value, str | int | float | bool) or key.endswith("opts")
            }
            yield f"{path} {said(dict(sorted(simple.items())))}"
    yield from map(said, NEEDS)


#: Command lines that end before anything is run.
REFUSED = """\
run
run nothing
run dodge --fail-under 80%
run dodge --coverage --port x
run dodge --profile --gdb 1
run dodge --coverage --gdb 0
run dodge --port x --mode direct
run dodge --port x --body kinematic
run dodge --port x --world room
run dodge --port x --seed 3
run dodge --port x --realtime 2
run dodge --yes
run dodge --max-speed 1m/s
run dodge --watch-variable a --port x
run two-dodge --watch-variable a
run dodge --ros dds --port x
run dodge --ros dds --gdb 1
run dodge --ros dds --coverage
run dodge --ros dds --inputs x
run dodge --inputs x --port y
run dodge --inputs x --gdb 1
run dodge --inputs x --profile
run dodge --foxglove-origin https://a
run dodge --foxglove 1 --port x
run dodge --foxglove 1 --gdb 1
run dodge --foxglove 1 --ros dds
run dodge --foxglove 1 --inputs x
run two-dodge --foxglove 1
run dodge --view --port x
run dodge --view --ros dds
run dodge --view --inputs x
run dodge --view --foxglove 1
run dodge --jobs 2
run dodge --junit x
run dodge --watch-variable nothing
run dodge --seeds 0-1 --ros dds
run dodge --seeds 0-1 --inputs x
run dodge --seeds 0-1 --foxglove 1
run dodge --seeds 0-1 --view
run dodge --seeds 0-1 --gdb 1
run dodge --seeds 0-1 --realtime 2
run dodge --seeds 0-1 --watch-variable a
run dodge --seeds 0-1 --coverage
run dodge --seeds 0-1 --profile
run dodge --seeds 0-1 --seed 1
run dodge --seeds 0-1 --port x
run dodge --seeds 0-1 --keep some
run dodge --seeds 0-1 --junit /nowhere/x.xml
run dodge --seeds 5-1
run dodge --set a
run dodge --set threshold_m=-1
run dodge --mode both
run dodge --adapter none
run dodge --record spi9
campaign
campaign a b
campaign x --search none
campaign new
campaign new dodge -j 2
campaign new dodge --json
campaign new dodge --dask local
campaign new dodge --scheduler x
campaign new dodge --against x
campaign new dodge --resume x
campaign x --dask other
campaign x --dask local --scheduler y
campaign comment
campaign comment nowhere
campaign --resume x y
campaign --resume x --runs 3
campaign --resume x --firmware y
campaign --resume x --against y
campaign --resume x --out y
campaign --resume nowhere
campaign nowhere.toml
campaign new dodge --runs 30 --seed 4 --search random
campaign new dodge
campaign new dodge --out b.toml
mutate x dodge
mutate dodge.elf nowhere
shrink nowhere
shrink .
shrink dodge --firmware nowhere.elf
shrink dodge --goal none
shrink dodge --out taken
shrink dodge --out taken/x.toml
check
check nowhere
check dodge rover motors
check dodge --firmware x
diff a b
report nowhere
report nowhere --ros2 mcap
report nowhere --events x.jsonl
board test
board test --emulated --adapter x
board test --fault open:DD3
board test --revision rev-z
board test --emulated --fault gone:DD3
board test --emulated --revision rev-a
validate nothing
validate motors --mode both
validate --port x --mode direct
validate --port x --body kinematic
validate --port x --seeds 0-1
validate slip --port x
validate slip long --port x
validate --port x --world room
validate --port x -j 2
validate --yes
validate motors --body none
fit
fit nowhere
fit x --truth a --truth b
fit taken --out taken/x
fit --example taken
fit --umbmark nowhere
sensitivity dodge
sensitivity dodge --vary a
sensitivity dodge --vary seed=0..1 --vary seed=0..2
sensitivity dodge --vary threshold_m=0.4..1 --steps 1 --trajectories 0
sensitivity dodge --vary threshold_m=-1..1
sensitivity dodge --vary threshold_m=0.4..99999
sensitivity dodge --vary threshold_m=0.4..1 --samples 3
compare
compare a b
compare a b --at noon
compare a b --align all
metrics nowhere
explain nowhere
new
new a --from b
new a --build ninja
new a --robot car
new --from b
new --from taken
new --from taken --robot rover
new taken
new --from . --build false
""".splitlines()


def refusals(_draw: Random) -> Iterator[str]:
    """Give verbs what cannot be."""
    loaded: dict[str, Scenario] = {}

    def load(*arguments: object, **named: object) -> Scenario:
        """Return a scenario, of each way to ask for it once: what is refused here is so whoever has loaded it."""
        key = repr((arguments, named))
        if key not in loaded:
            loaded[key] = load_scenario(*arguments, **named)  # type: ignore[arg-type]  # as they come
        return loaded[key]

    with in_folder() as folder, mock.patch.object(run_verb, "load_scenario", load):
        (folder / "taken").mkdir()
        (folder / "taken" / "x.toml").write_text("x", encoding="utf-8")
        for line in REFUSED:
            yield f"$ {line}"
            yield from (line.replace(str(folder), "HERE") for line in printed(p2os, line.split()))
            for made in sorted(path for path in folder.glob("*") if path.name != "taken"):
                yield f"{made.name}: {said(sorted(path.name for path in made.rglob('*')))}"
                if made.is_file():
                    yield made.read_text(encoding="utf-8").partition("\n\n")[0]
                    made.unlink()
                else:
                    rmtree(made)


def scenario_words(one: object) -> object:
    if isinstance(one, list):
        return [[scenario_words(row.scenario), row.settings, row.replay] for row in one]
    if not isinstance(one, Scenario):
        return Path(one).name if isinstance(one, Path) and one.is_absolute() else one
    adapter = one.adapter
    return [
        one.name,
        one.mode,
        one.body == "kinematic",
        one.seed,
        one.world,
        one.duration_ns,
        one.usart_baud,
        one.record,
        one.adapter_core,
        one.firmware.name,
        adapter.max_velocity_mm_s,
        adapter.max_rotation_deg_s,
    ]


def handed_on(_draw: Random) -> Iterator[str]:
    """Run runs whose work is only noted: which scenario, where to, how fast, with what beside."""
    reported: list[str] = []

    def noted(name: str) -> Any:
        def note(*arguments: object, **named: object) -> RunResult:
            plain = {
                key: value if isinstance(value, int | float | str | bool | tuple | list | None) else type(value)
                for key, value in named.items()
            }
            reported.append(
                f"{name} {said([scenario_words(one) for one in arguments])} {said(plain)}".split(" object at ")[0]
            )
            return result_of()

        return note

    @contextlib.contextmanager
    def page(*_: object, **named: object) -> Iterator[object]:
        reported.append(f"page {said({key: value for key, value in named.items() if key != 'display'})}")
        yield None

    works = {
        name: mock.patch.object(run_verb, name, noted(name))
        for name in ("run_scenario", "run_many", "drive_port", "run_viewed_fleet")
    }
    with in_folder(), contextlib.ExitStack() as stack:
        for work in works.values():
            stack.enter_context(work)
        stack.enter_context(mock.patch.object(run_verb, "viewed", page))
        stack.enter_context(mock.patch("robot_bench.cli.demo.run_scenario", noted("demo")))
        stack.enter_context(mock.patch.object(run_verb, "core_count", return_value=3))
        for line in (
            "run dodge",
            "run dodge --realtime",
            "run dodge --realtime 2.5 --json",
            "run dodge --view",
            "run dodge --force",
            "run dodge --view --realtime 4 --watch-variable ticks --no-browser",
            "run two-dodge --view --realtime 2",
            "run two-dodge",
            "run dodge --mode direct --body kinematic --seed 9 --duration 2s --out there",
            "run dodge --usart-baud 9600 --record spi1,can --adapter firmware --world arena --coverage --profile",
            "run dodge --coverage --fail-under 80",
            "run dodge --watch-variable ticks",
            "run dodge --seeds 0-2",
            "run dodge --seeds 0-2 -j 2 --keep all --junit r.xml --json --force",
            "run dodge --set threshold_m=0.4",
            "run dodge --port serial:/dev/x --yes --max-speed 0.2m/s",
            "run dodge --port x --gdb 3333 --mode adapter",
            "demo",
            "demo --duration 20s --out there --force --json",
        ):
            reported.clear()
            ended = [*printed(p2os, line.split())]
            yield f"$ {line}: {reported} {ended}"
    dodge = load_scenario("dodge")
    for one in (dodge, replace(dodge, adapter=replace(dodge.adapter, max_velocity_mm_s=150, max_rotation_deg_s=20))):
        for speed in (None, 0.1234):
            yield said(scenario_words(run_verb.capped(one, speed)))
    for seeds, seed, port in ((None, None, None), ("0", None, "x"), (None, 1, None), (None, None, "x")):
        for about in (dodge, replace(dodge, seeds=(1, 2)), load_scenario("two-dodge")):
            yield said(run_verb.is_sweep(about, seeds=seeds, seed=seed, port=port))


def projects(draw: Random) -> Iterator[str]:
    """Look at folders of projects of every kind."""
    elf = b"\x7fELF"
    for layout in existing.LAYOUTS:
        yield said(layout).partition(", <function")[0]
    with in_folder() as folder:
        yield tried(existing.layout_of, folder / "none").replace(str(folder), "HERE")
        yield tried(existing.layout_of, folder).replace(str(folder), "HERE")
        for number, layout in enumerate(existing.LAYOUTS):
            place = folder / f"p{number}"
            for sign in layout.signs[:1]:
                file = place / sign.replace("*", "x")
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text("{}", encoding="utf-8")
            yield existing.layout_of(place).name
            yield tried(existing.find_project, place, layout).replace(str(folder), "HERE")
            for time, pattern in enumerate(layout.programs):
                program = place / pattern.replace("*", "made")
                program.parent.mkdir(parents=True, exist_ok=True)
                program.write_bytes(elf if time or number else b"none")
                os.utime(program, ns=(10 * time + 10,) * 2)
                other = program.with_name("firmware.elf" if number == 0 else "other.elf")
                other.write_bytes(elf)
                os.utime(other, ns=(10 * time + draw.choice((9, 10, 11)),) * 2)
            for source in layout.sources[-1:]:
                (place / source).mkdir(parents=True)
            with mock.patch.object(existing, "load_image"):
                found = existing.find_project(place, layout, draw.choice(("", 'say "hi" \\')))
            yield said(replace(found, folder=Path("P"))).partition(", ProjectLayout")[0]
            yield said([found.program, [*found.others], found.sources, found.build, found.name])
            for name, text in existing.files_beside(found, "kinematic").items():
                reported = [line for line in text.splitlines() if "made" in line or "kinematic" in line]
                yield f"{name} {len(text)} {reported}"
        (folder / "CMakePresets.json").write_text(
            '{"configurePresets": [{"binaryDir": "${sourceDir}/out/${presetName}/", "name": "a"}, {"binaryDir": "/x"},'
            ' {"binaryDir": "../y"}, {"binaryDir": "$env{HOME}/z"}, {"binaryDir": "o/${presetName}"},'
            ' {"name": "none"}]}',
            encoding="utf-8",
        )
        (folder / "CMakeUserPresets.json").write_text("[1]", encoding="utf-8")
        yield said(existing.preset_programs(folder))
    yield said(
        [
            existing._twice(at)
            for at in (0, 1, 5_000_000, 5_000_001, 499_999_999, 500_000_000, 500_000_001, 700_000_000, 3_333_333_333)
        ]
    )
    wires = {
        name: SimpleNamespace(times=[0, at, at + 9], levels=[0, level, 1 - level])
        for name, at, level in (
            ("p2dx_con", 700, 1),
            ("motor1_comm1", 900_000_000, 0),
            ("motor1_comm2", 5, 1),
            ("motor2_comm1", 5, 0),
            ("DD1", 1, 1),
        )
    }
    wires["motor2_comm3"] = SimpleNamespace(times=[0], levels=[0])
    for lines in ([], [(3, "  "), (7_000_000, "hello 'you'"), (9, "no")]):
        record = SimpleNamespace(pins=wires, usart_lines=lambda lines=lines: lines)
        yield from existing._tests_of(SimpleNamespace(record=lambda record=record: record))  # type: ignore[arg-type]


def completions(_draw: Random) -> Iterator[str]:
    """Complete names as a shell asks for them."""
    for begun in ("", "d", "two", "x"):
        yield said(names.scenario_names(begun))
    for params, words in (
        ({}, []),
        ({"scenario": "dodge"}, []),
        ({}, ["two-dodge"]),
        ({"scenario": "none"}, []),
        ({"scenario": "rover"}, []),
    ):
        context: Any = SimpleNamespace(params=params, args=words)
        for begun in ("", "start.", "mode=", "goal.1."):
            yield said(names.setting_keys(context, begun))
        yield said(names.variable_names(context, "t"))


TRACES = {  # what takes long comes last
    "handed_on": handed_on,
    "projects": projects,
    "completions": completions,
    "declared": declared_of(
        "robot_bench.cli", "robot_bench.cli.experiments", "robot_bench.cli.campaigns", "robot_bench.cli.project"
    ),
    "options": options,
    "refusals": refusals,
}

test_what_verbs_have_and_show_is_what_was_approved = judge_of(__file__, TRACES)
