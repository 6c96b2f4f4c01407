"""A project that is there already: its layout, its program and sources, and what the bench puts beside them.

Each row of `LAYOUTS` is a way in which BluePill programs are really built. Its signs say whether a folder is laid out
so, its patterns where the program is after a build.

Invariant: no file of the project is changed or overwritten; what has to be added to one is said.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from adapter_sim.pinout import WireRole, load_pinout
from bluepill_sim.program.image import ELF_MAGIC, load_image
from robot_bench.bench import Bench
from robot_bench.cli.project.files import text_of_package
from simbase.errors import FileError, UsageError, shown_name
from simbase.files import read_text
from simbase.timing import NS_PER_MS, NS_PER_S

#: The folder of the project that the scenario and its tests are in.
FOLDER = "bench"
SCENARIO, TESTS = f"{FOLDER}/bench.toml", f"{FOLDER}/test_bench.py"
#: chosen: so long a program is watched for what its tests are to expect.
WATCHED = "2 s"
#: chosen: of what was seen so many wires get a test each.
MOST_WIRES = 3
#: Wires that a program drives.
OUTPUTS = (WireRole.CONNECT, WireRole.RESET, WireRole.MOTOR)
#: Of CMake's presets: `${hostSystemName}`, `$env{HOME}`.
_MACRO = re.compile(r"\$\w*\{[^}]*\}")
_PRESETS = ("CMakePresets.json", "CMakeUserPresets.json")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectLayout:
    """A way in which projects are laid out."""

    name: str
    #: Patterns of files, one of which every such project has.
    signs: Sequence[str]
    #: Patterns of its program; the first that finds any counts.
    programs: Sequence[str]
    #: Folders of its sources; the first that is there counts, else the project's own.
    sources: Sequence[str] = ("src",)
    #: The command that builds it; `{made}` is the folder that its program is in.
    build: str
    made: str = "build"
    #: File of the project → file of `beside/` that ties the bench into what builds it.
    ties: Mapping[str, str] = field(default_factory=dict)
    #: What the user adds to a file of his for that.
    add: str = ""
    #: Whether that is to be added only where one of `ties` was there already.
    is_tied: bool = False
    #: What does the same then as `p2os run`.
    then: str = ""
    #: More patterns of its program, out of its own files.
    more_programs: Callable[[Path], list[str]] = lambda _: []


def preset_programs(folder: Path) -> list[str]:
    """Return patterns of programs in the build folders that CMake's presets name."""
    found: list[str] = []
    for name in _PRESETS:
        try:
            presets = json.loads(read_text(folder / name, FileError)).get("configurePresets", [])
            named = [(str(one["binaryDir"]), str(one.get("name", ""))) for one in presets if "binaryDir" in one]
        except (FileError, ValueError, AttributeError, TypeError, KeyError, RecursionError):
            continue  # it is not there, or CMake will say what is wrong with it
        for said, preset in named:
            place = said.replace("${sourceDir}/", "").replace("${presetName}", preset or "*")
            place = _MACRO.sub("*", place).rstrip("/")
            if not Path(place).is_absolute() and ".." not in Path(place).parts:
                found += [f"{place}/*.elf", f"{place}/*/*.elf"]
    return found


_CMAKE_TIE = {f"{FOLDER}/bench.cmake": "bench.cmake"}
_CUBE = ("Core/Src", "Src")
#: The more particular ones first: a Zephyr program has a CMakeLists.txt, and STM32CubeMX writes Makefiles.
LAYOUTS: Sequence[ProjectLayout] = (
    ProjectLayout(
        name="PlatformIO", signs=("platformio.ini",), programs=(".pio/build/*/firmware.elf",), build="pio run",
        ties={f"{FOLDER}/pio_bench.py": "pio_bench"},
        add="platformio.ini, under [env:…]: extra_scripts = bench/pio_bench.py", then="pio run -t bench",
    ),
    ProjectLayout(
        name="Rust", signs=("Cargo.toml",),
        programs=("target/thumbv7m-none-eabi/debug/*", "target/thumbv7m-none-eabi/release/*"), build="cargo build",
        ties={".cargo/config.toml": "cargo.toml"},
        add=".cargo/config.toml, under [target.thumbv7m-none-eabi]: "
        'runner = "p2os run bench/bench.toml --firmware"', is_tied=True, then="cargo run",
    ),
    ProjectLayout(
        name="Zephyr", signs=("prj.conf",), programs=("build/zephyr/zephyr.elf", "build/*/zephyr/zephyr.elf"),
        build="west build", ties=_CMAKE_TIE,
        add="CMakeLists.txt, at its end: include(bench/bench.cmake) and bench_program(zephyr_final)",
        then="west build -t bench",
    ),
    ProjectLayout(
        name="STM32CubeIDE", signs=(".cproject",), programs=("Debug/*.elf", "Release/*.elf"), sources=_CUBE,
        build="make -C {made} all", made="Debug",
    ),
    ProjectLayout(
        name="Arduino", signs=("*.ino",), programs=("build/*.elf", "build/*/*.elf"), sources=(),
        build="arduino-cli compile --export-binaries",
    ),
    ProjectLayout(
        name="CMake", signs=("CMakeLists.txt",), more_programs=preset_programs,
        programs=("build/*.elf", "build/*/*.elf", "cmake-build-*/*.elf"), sources=("src", *_CUBE),
        build="cmake --build {made}", ties=_CMAKE_TIE,
        add="CMakeLists.txt, at its end: include(bench/bench.cmake) and bench_program(NAME)",
        then="cmake -B {made} && cmake --build {made} --target bench",
    ),
    ProjectLayout(
        name="STM32CubeMX", signs=("*.ioc",), programs=("build/*.elf",), sources=_CUBE, build="make",
    ),
    ProjectLayout(
        name="make", signs=("Makefile", "makefile", "GNUmakefile"), programs=("build/*.elf", "*.elf", "*/*.elf"),
        sources=("src", *_CUBE), build="make",
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundProject:
    """A project, and what of it the bench needs."""

    folder: Path
    layout: ProjectLayout
    #: As seen from the folder.
    program: Path
    #: Other programs that its build has made.
    others: Sequence[Path]
    sources: Path
    build: str

    @property
    def name(self) -> str:
        """What it is called."""
        return self.folder.resolve().name


def layout_of(folder: Path) -> ProjectLayout:
    """Return how a project is laid out.

    Raises:
        UsageError: There is no such folder, or nothing in it is known.
    """
    if not folder.is_dir():
        raise UsageError(f"there is no folder {shown_name(folder)}", hint="--from takes the folder of a project")
    found = next((one for one in LAYOUTS if any(any(folder.glob(sign)) for sign in one.signs)), None)
    if found is None:
        known = ", ".join(dict.fromkeys(sign for one in LAYOUTS for sign in one.signs))
        raise UsageError(f"{shown_name(folder)} is laid out in no known way", hint=f"one of these is in it: {known}")
    return found


def find_project(folder: Path, layout: ProjectLayout, build: str = "") -> FoundProject:
    """Return a project that has been built.

    Args:
        folder: Of the project.
        layout: How it is laid out.
        build: The command that builds it; empty is that of its layout.

    Raises:
        UsageError: It has no program; it was not built yet.
        FileError: Its program is none for this chip.
    """
    patterns = [*layout.more_programs(folder), *layout.programs]
    made = next((found for pattern in patterns if (found := _programs(folder, pattern))), [])
    if not made:
        raise UsageError(
            f"{shown_name(folder)} ({layout.name}) has no program (looked for {', '.join(patterns)})",
            hint=f"build it first, or let it be built: --build '{build or layout.build.format(made=layout.made)}'",
        )
    program, *others = made
    load_image(folder / program)
    sources = next((Path(name) for name in layout.sources if (folder / name).is_dir()), Path())
    return FoundProject(
        folder=folder, layout=layout, program=program, others=others, sources=sources,
        build=build or layout.build.format(made=program.parent.as_posix()),
    )  # fmt: skip


def _programs(folder: Path, pattern: str) -> list[Path]:
    """Return the ELF files that a pattern finds, the newest first."""
    found = [path for path in folder.glob(pattern) if path.is_file() and _is_elf(path)]
    return [path.relative_to(folder) for path in sorted(found, key=lambda path: (-path.stat().st_mtime_ns, path.name))]


def _is_elf(path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            return stream.read(len(ELF_MAGIC)) == ELF_MAGIC
    except OSError:
        return False


def files_beside(found: FoundProject, body: str) -> dict[str, str]:
    """Return the text of each file that the bench puts beside a project, by its path in the project's folder.

    Args:
        found: The project.
        body: The body that its scenario names.
    """
    words = {
        "@NAME@": found.name, "@ELF@": f"../{found.program.as_posix()}", "@BODY@": body,
        "@BUILD@": found.build.replace("\\", "\\\\").replace('"', '\\"'),
    }  # fmt: skip
    beside = {
        SCENARIO: "bench.toml", TESTS: "test_bench", ".vscode/tasks.json": "tasks.json",
        **found.layout.ties,
    }  # fmt: skip
    texts = {name: text_of_package("robot_bench.cli.project", f"beside/{source}") for name, source in beside.items()}
    texts[".vscode/launch.json"] = (
        text_of_package("robot_bench.cli.project", "template/launch.json")
        .replace("just-drive.toml", SCENARIO)
        .replace("@ELF@", found.program.as_posix())
    )
    for word, value in words.items():
        texts = {name: text.replace(word, value) for name, text in texts.items()}
    return texts


def seen_tests(scenario: Path) -> str:
    """Return tests that expect what a program does in its first two seconds on the bench, each in twice its time.

    Raises:
        P2osError: The scenario cannot be run.
    """
    bench = Bench.from_scenario(str(scenario), body="kinematic")  # quicker, and no robot moves so soon
    bench.run_until(WATCHED)
    bench.finish()
    return "".join(f"\n\n{one}" for one in _tests_of(bench))


def _tests_of(bench: Bench) -> Iterator[str]:
    record = bench.record()
    line = next(((at, text) for at, text in record.usart_lines() if text.strip()), None)
    if line is not None:
        yield (
            "def test_it_prints_its_first_line(bench):\n"
            f'    bench.expect_text({line[1]!r}, within="{_twice(line[0])}")\n'
        )
    driven_by_it = {wire.name for role in OUTPUTS for wire in load_pinout().with_role(role)}
    driven = [
        (edges.times[1], edges.levels[1], net)
        for net, edges in record.pins.items()
        if net in driven_by_it and len(edges.times) > 1
    ]
    for at, level, net in sorted(driven)[:MOST_WIRES]:
        name, word = re.sub(r"\W+", "_", net), "high" if level else "low"
        yield (
            f"def test_{name}_goes_{word}(bench):\n"
            f'    bench.expect_pin("{net}", "{word}", within="{_twice(at)}")\n'
        )  # fmt: skip


def _twice(at_ns: int) -> str:
    """Return twice a time as a person writes it: rounded up to 10 ms, and to 100 ms from a second on."""
    step = 10 * NS_PER_MS if 2 * at_ns < NS_PER_S else 100 * NS_PER_MS
    return f"{max(1, -(-2 * at_ns // step)) * step // NS_PER_MS} ms"
