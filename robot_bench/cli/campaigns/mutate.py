"""`p2os mutate`: how many wrong programs the goals of some scenarios notice."""

import json
import random
import time
from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated, cast

import typer

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.board import BluePill
from bluepill_sim.program.elf_file import file_bytes
from bluepill_sim.program.image import ELF_MAGIC, Image
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.mutants import Mutant, mutants, mutated_file
from bluepill_sim.program.static_code import StaticCode
from p2os.cli.groups import BENCH
from p2os.cli.names import bodies
from p2os.cli.quantities import option
from p2os.cli.trust import Trusted, said
from robot_bench.campaign.variants.mutation.base_run import BaseRun, base_run
from robot_bench.campaign.variants.mutation.report import Mutation, as_json, report_lines, write_junit
from robot_bench.campaign.variants.mutation.suite import Suite, SuiteRun, load_pytest, run_suite
from robot_bench.campaign.variants.mutation.trial import MOST_MORE_NS, MOST_TIMES, Fate, MutantResult, try_mutant
from robot_bench.cli.names import scenario_names
from robot_bench.cli.progress import RunDisplay, counting_bar
from robot_bench.cli.sweep import refuse_junit
from robot_bench.cli.workers import Jobs, core_count, run_in_processes
from robot_bench.events.codec import Json
from robot_bench.recording.summary import INTERRUPTED
from robot_bench.scenario.included_files import read_setting
from robot_bench.scenario.loading import load_scenario
from simbase.command_line.program import EXIT_INTERRUPTED
from simbase.errors import UsageError
from simbase.files import writing
from simbase.timing import NS_PER_S
from simbase.units import COUNT, PERCENT, SEED

HELP = """Test a scenario's goals by programs with planted errors.

Each instruction of FIRMWARE that the scenarios execute is changed in turn: a
branch inverted, always taken or never taken; a comparison or number moved by
one; a sign changed. The mutant runs the scenarios that execute it, from just
before the change matters. A missed goal or a fault notices it. Survivors are
listed: no goal checks what they do wrong.

The score of a --sample has a 95 % interval, and --fail-under uses its lower
end; without --sample the score is exact.

Exit code: 0 done, 1 the score is below --fail-under, 2 wrong usage or file.

\b
Examples:
  p2os mutate build/robot.elf patrol.toml        all mutants, and those that survived
  p2os mutate build/robot.elf tests              the score of your tests (pytest)
  p2os mutate dodge.elf dodge --sample 100       a hundred of them, drawn by --seed
  p2os mutate dodge.elf dodge --only dodge_fsm.c --body kinematic
  p2os mutate build/robot.elf patrol.toml --fail-under 80%    for CI
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("mutate", help=HELP, rich_help_panel=BENCH)(mutate)


def mutate(
    firmware: Annotated[Path, typer.Argument(help="ELF, HEX or BIN file.", metavar="FIRMWARE")],
    scenarios: Annotated[
        list[str],
        typer.Argument(
            help="Names or TOML files with goals; tests of pytest.",
            metavar="SCENARIO",
            autocompletion=scenario_names,
        ),
    ],
    sample: Annotated[
        int | None, option(COUNT, "--sample", purpose="So many of the mutants, drawn; default all.", above_zero=True)
    ] = None,
    seed: Annotated[int, option(SEED, "--seed", purpose="Of the draw.", shown="0", least="0")] = 0,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="Source file or function; * stands for any; repeatable.", metavar="NAME"),
    ] = None,
    mode: Annotated[str | None, typer.Option(help="As of p2os run.", metavar="direct|adapter")] = None,
    body: Annotated[
        str | None, typer.Option(help="As of p2os run; kinematic is quick.", metavar="BODY", autocompletion=bodies)
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="A key of the scenarios; repeatable.", metavar="KEY=VALUE")
    ] = None,
    jobs: Jobs = None,
    fail_under: Annotated[
        float, option(PERCENT, "--fail-under", purpose="Least score.", shown="0%", least="0%", most="100%")
    ] = 0.0,
    write: Annotated[
        Path | None, typer.Option(help="Write the survivors there, as firmware files.", metavar="FOLDER")
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="Write what CI reads.", metavar="FILE")] = None,
    trust: Trusted = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Judge goals."""
    settings = [read_setting(text) for text in set_ or ()]
    paths = tuple(Path(name) for name in scenarios if name.endswith(".py") or Path(name).is_dir())
    wanted = [
        load_scenario(name, firmware=firmware, settings=settings, trust=said(trust)).with_options(
            firmware=firmware, mode=mode, body=body
        )
        for name in scenarios if Path(name) not in paths
    ]  # fmt: skip
    if junit is not None:
        refuse_junit(junit)
    if write is not None:
        with writing(write, hint="--write takes a folder"):
            write.mkdir(parents=True, exist_ok=True)
    with RunDisplay(is_shown=False) as display:
        bases = [base_run(one, time.process_time_ns, display.raise_if_interrupted) for one in wanted]
        board = BluePill(firmware)
        suite = _suite(paths, board, display.raise_if_interrupted) if paths else None
        ran = {address for base in bases for address in base.first_ns} | (suite.base.addresses if suite else set())
        names = Coverage(board.image, read_lines(board.image), StaticCode(board.chip.memory))
        possible = _chosen(board.image, ran, names, only or [])
        tried = possible if sample is None or sample >= len(possible) else _drawn(possible, sample, seed)
        found, broken, is_whole = _try_all(tried, bases, suite, jobs or core_count(), display.raise_if_interrupted)
    mutation = Mutation(
        firmware=firmware, scenarios=[*(one.name for one in wanted), *map(str, paths)], instructions=len(ran),
        possible=len(possible), seed=seed if len(tried) < len(possible) else None, tried=tried, found=found,
        coverage=names, lines=read_lines(board.image),
    )  # fmt: skip
    if json_output:
        typer.echo(json.dumps(as_json(mutation), sort_keys=True))
    else:
        for line in report_lines(mutation):
            typer.echo(line)
    if write is not None:
        _write(mutation, board.image, write)
    if junit is not None:
        write_junit(mutation, junit)
    if not is_whole:
        raise typer.Exit(EXIT_INTERRUPTED)
    if broken:
        typer.echo(f"{len(broken)} could not be run, first {broken[0]}", err=True)
        raise typer.Exit(1)
    bounds = mutation.bounds
    if fail_under and (bounds is None or bounds[0] < fail_under):
        typer.echo(_below(mutation, fail_under), err=True)
        raise typer.Exit(1)


def _below(mutation: Mutation, fail_under: float) -> str:
    """Return why the score does not do."""
    if mutation.score is None or mutation.bounds is None or mutation.score < fail_under:
        return f"the score is below {fail_under:g} %"
    return (
        f"the score may be below {fail_under:g} %: by a sample of {len(mutation.pairs)} of {mutation.possible} it is "
        f"{mutation.bounds[0]:.1f} % at least\nhint: a greater --sample, or none for the exact score"
    )


def _suite(paths: tuple[Path, ...], board: BluePill, raise_if_interrupted: Callable[[], None]) -> Suite:
    """Return tests that have passed with the program itself, in a process of their own.

    Raises:
        UsageError: They do not.
    """
    firmware, found = Path(board.image.name), SuiteRun()

    def on_done(_number: int, plain: Json) -> None:
        nonlocal found
        found = SuiteRun.from_plain(plain) if "sha256" in plain else SuiteRun(broken=str(plain["failures"]))

    def job(_number: int, _look: Callable[[], None]) -> Json:
        began = time.process_time()
        found = run_suite(paths, firmware)
        found.cpu_s = time.process_time() - began
        return found.to_plain()

    load_pytest()
    run_in_processes(job, 1, at_once=1, on_done=on_done, raise_if_interrupted=raise_if_interrupted)
    said = " ".join(map(str, paths))
    if found.failed or found.broken:
        why = found.broken or f"{found.failed} fails"
        raise UsageError(f"the tests do not pass with the program itself: {why}", hint=f"pytest {said} shows it")
    if not found.addresses:
        raise UsageError(f"no test of {said} drives the fixture bench", hint="docs/bench.md, tests of a firmware")
    return Suite(paths=paths, base=found, data=file_bytes(board.image), image=board.image)


def _chosen(image: Image, ran: set[int], names: Coverage, only: Sequence[str]) -> list[Mutant]:
    """Return the mutants of all instructions that ran, of the files and functions asked for.

    Raises:
        UsageError: There is none.
    """

    def is_wanted(address: int) -> bool:
        here = names.place(address).partition(":")[0], names.function_name(address)
        return not only or any(fnmatch(name, pattern) for name in here for pattern in only)

    found = mutants(image, filter(is_wanted, ran))
    if not found:
        what = f"of {' and '.join(only)} " if only else ""
        raise UsageError(f"nothing {what}that ran can be changed", hint="p2os run --coverage shows what runs")
    return found


def _drawn(possible: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """Return so many mutants, in their order."""
    chosen = sorted(random.Random(seed).sample(range(len(possible)), count))
    return [possible[number] for number in chosen]


def _try_all(
    tried: Sequence[Mutant],
    bases: Sequence[BaseRun],
    suite: Suite | None,
    jobs: int,
    raise_if_interrupted: Callable[[], None],
) -> tuple[list[MutantResult | None], list[str], bool]:
    """Return what came of each mutant, which could not be run and why, and whether nothing interrupted them."""
    found: list[MutantResult | None] = [None] * len(tried)
    broken: list[str] = []

    def job(number: int, look: Callable[[], None]) -> Json:
        mutant = tried[number]
        found = try_mutant(mutant, bases, time.process_time_ns, look)
        if suite is not None and not found.is_noticed and mutant.address in suite.base.addresses:
            by_tests = suite.try_mutant(mutant, round(MOST_TIMES * suite.base.cpu_s + MOST_MORE_NS / NS_PER_S))
            found = by_tests if found.fate is Fate.SAME or by_tests.is_noticed else found
        return found.to_plain()

    with counting_bar("mutants", len(tried)) as tell:
        done = 0

        def on_done(number: int, plain: Json) -> None:
            nonlocal done
            if "fate" in plain:
                found[number] = MutantResult.from_plain(plain)
            elif f"{plain['failures']}".endswith("SIGXCPU']"):
                found[number] = MutantResult(Fate.STOPPED, "pytest", "they take too long")
            elif (why := cast("list[str]", plain["failures"])[0]) != INTERRUPTED:
                broken.append(f"{tried[number].address:#010x}: {why}")
            survived = sum(one is not None and not one.is_noticed for one in found)
            done += 1
            tell(done, f"{survived} not noticed")

        is_whole = run_in_processes(
            job, len(tried), at_once=jobs, on_done=on_done, raise_if_interrupted=raise_if_interrupted
        )
    return found, broken, is_whole


def _write(mutation: Mutation, image: Image, folder: Path) -> None:
    """Write each survivor as a firmware file.

    Raises:
        FileError: The folder cannot be written.
    """
    data = file_bytes(image)
    suffix = ".elf" if data.startswith(ELF_MAGIC) else ".bin"
    with writing(folder):
        for mutant in mutation.survivors:
            name = f"{mutant.address:08x}-{mutant.alteration.code.hex()}{suffix}"
            (folder / name).write_bytes(mutated_file(data, mutant, image))
