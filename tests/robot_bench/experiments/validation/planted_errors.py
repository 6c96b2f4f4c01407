"""Errors planted into copies of the sources, one at a time, and which experiment tells of each.

    python -m tests.robot_bench.experiments.validation.planted_errors             all rows, with what told of each
    python -m tests.robot_bench.experiments.validation.planted_errors 3 5         some of them
    python -m tests.robot_bench.experiments.validation.planted_errors --file adapter_fw/core/adapter/mixing.cpp \
        --old "second - first" --new "first - second"                             an error of one's own, all experiments

The adapter's firmware (C++) is compiled into a library of its own, a program of the BluePill (C) into an ELF, a module
of Python is imported in place of the original. Each row runs in a process of its own; nothing in the tree is touched.
"""

import argparse
import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path

from tests.tools.forked_python import forked_python

ROOT = Path(__file__).parents[4]
PROGRAMS = "robot_bench/firmware/"
COMPILE = ("g++", "-std=c++17", "-O0", "-fPIC", "-w", "-fno-exceptions", "-fno-rtti")
MODEL, FIRMWARE = ("adapter", "model"), ("adapter", "firmware")
DIRECT = ("direct", "")
RPM, PACKETS, READINGS, SEEN, ANGLE = (
    "steady rim speed", "encoder code against the packets' odometry", "readings in packets that stand on their pins",
    "things seen by their own sensor, and by no other", "encoder code against the wheel's angle",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Planted:
    """An error: what it is, where it is written, which experiment has to tell of it, and by which figure."""

    error: str
    path: str
    old: str
    new: str
    experiment: str
    figure: str
    variant: tuple[str, str]


_FW, _MODEL, _ROBOT = "adapter_fw/core/adapter/", "adapter_sim/", "p2os/pioneer/"
PLANTED: Sequence[Planted] = (
    # the adapter's firmware, C++
    Planted("wheels swapped in the turn", f"{_FW}mixing.cpp", "(second - first) * DEG", "(first - second) * DEG",
            "codes", "RVEL for a pair of codes", FIRMWARE),
    Planted("right encoder: sign of the turn", f"{_FW}encoders.cpp", "offset_nm_.right + forward_nm + rim_nm",
            "offset_nm_.right + forward_nm - rim_nm", "encoders", PACKETS, FIRMWARE),
    Planted("encoders: scale, 1 %", f"{_FW}encoders.cpp", "travel.left * steps", "travel.left * steps * 101 / 100",
            "encoders", PACKETS, FIRMWARE),
    Planted("encoders: wrap of the position", f"{_FW}encoders.cpp", "POSITION_MODULUS = 1 << 15",
            "POSITION_MODULUS = 1 << 16", "encoders", PACKETS, FIRMWARE),
    Planted("encoders: offset of a code", f"{_FW}outputs.cpp", "(counts.left) & code", "(counts.left + 1) & code",
            "encoders", ANGLE, FIRMWARE),
    Planted("encoders swapped", f"{_FW}outputs.cpp", "left | right << wires_", "right | left << wires_",
            "encoders", PACKETS, FIRMWARE),
    Planted("threshold 5 mm nearer", f"{_FW}distances.cpp", "reading.range_um < threshold_um_",
            "reading.range_um < threshold_um_ - 5000", "sensors-all", READINGS, FIRMWARE),
    Planted("neighbouring sonar exchanged", f"{_FW}distances.cpp", "size_t>(number)] = {range",
            "size_t>(number ^ 1)] = {range", "sensors", SEEN, FIRMWARE),
    Planted("a reading forgotten too early", f"{_FW}distances.hpp", "stale_ns_(stale_ns)", "stale_ns_(stale_ns / 5)",
            "sensors", "changes of a distance pin without a reading", FIRMWARE),
    Planted("motor value without a sign", f"{_FW}inputs.cpp", "^ sign) - sign", "^ sign) - sign + (bits == 4U)",
            "motors", "VEL for a pair of codes", FIRMWARE),
    Planted("commands rounded towards zero", f"{_FW}mixing.cpp", "divide_half_away(first + second, 2'000)",
            "(first + second) / 2'000", "codes", "VEL for a pair of codes", FIRMWARE),
    Planted("pairs of commands spaced twice as far", f"{_FW}driver.cpp", "sent_at_ + spacing_ns_)",
            "sent_at_ + 2 * spacing_ns_)", "motors", "change of the pins to the robot's last command", FIRMWARE),
    Planted("votes of all samples", f"{_FW}inputs.cpp", "2 * same <= count_", "same < count_",
            "motors", "the same, where the line is free", FIRMWARE),
    Planted("a cap that the turn does not follow", f"{_FW}mixing.cpp",
            "turn = scaled(turn, max_velocity_mm_s_, size_of_number(forward));", "", "capped",
            "RVEL for a pair of codes", FIRMWARE),
    Planted("a robot is given up 5 % early", f"{_FW}transitions.cpp", "received_at + settings_.liveness_ns",
            "received_at + settings_.liveness_ns * 19 / 20", "silence",
            "seeing the last packet to the distance pins that are safe", FIRMWARE),
    # the adapter's model, Python
    Planted("ranges 2 % long", f"{_MODEL}distances.py", "self._readings[number] = (range_um, now)",
            "self._readings[number] = (range_um * 51 // 50, now)", "sensors-all", READINGS, MODEL),
    Planted("position of 16 bits", f"{_MODEL}encoders.py", "self._x = Unwrapper(POSITION_MODULUS)",
            "self._x = Unwrapper(2 * POSITION_MODULUS)", "encoders", PACKETS, MODEL),
    Planted("heading lost on its wrap", f"{_MODEL}encoders.py", "self._heading += turn",
            "self._heading += turn if abs(turn) < 60 else 0", "sparse", PACKETS, MODEL),
    # the virtual robot
    Planted("odometry: track 1 % wider", f"{_ROBOT}controller/dead_reckoning.py", "self._track_mm = track_mm / track",
            "self._track_mm = track_mm / track * 1.01", "encoders", ANGLE, MODEL),
    Planted("the watchdog 5 % slow", "p2os/protocol/connection.py", "self._last_frame_ns + self._watchdog_ns",
            "self._last_frame_ns + self._watchdog_ns * 21 // 20", "silence",
            "the last command to the ramp of the stop", MODEL),
    Planted("sonar 1 cm too far", f"{_ROBOT}sonar/errors.py", "range_m = min(true_m, longest)",
            "range_m = min(true_m + 0.011, longest)", "sensors-all", SEEN, MODEL),
    # the bench, mode direct
    Planted("distance pins: threshold included by 15 mm", "robot_bench/direct/distance.py", "* UM_PER_M)",
            "* UM_PER_M) + 15_000", "sensors-all", SEEN, DIRECT),
    # a program of the BluePill
    Planted("odometer: a step lost on the wrap of the code", f"{PROGRAMS}odometer.c", "wheel->steps += difference;",
            "wheel->steps += code == 0 && difference > 0 ? 0 : difference;", "encoders",
            "steps that the program counts", DIRECT),
    Planted("tick 1 % slow", f"{PROGRAMS}tick.c", "HCLK_HZ / TICKS_PER_S - 1u", "HCLK_HZ / TICKS_PER_S * 101u / 100u",
            "motors", "time that a pair is held", DIRECT),
    Planted("the first sensor left out", f"{PROGRAMS}sensors.c", "seen ? SPEED : 0, seen ? SPEED : 0",
            "seen & 0xFE ? SPEED : 0, seen & 0xFE ? SPEED : 0", "only-while-seen",
            "first sensor on, or last one off, to the motor pins", DIRECT),
)  # fmt: skip


def changed(planted: Planted) -> str:
    """Return the text of the file with its error.

    Raises:
        ValueError: The file does not have the old text.
    """
    text = (ROOT / planted.path).read_text(encoding="utf-8")
    if planted.old not in text:
        raise ValueError(f"{planted.path} has no {planted.old!r}")
    return text.replace(planted.old, planted.new, 1)


def library(planted: Planted, folder: Path) -> Path:
    """Return the adapter's firmware with the error, compiled."""
    modules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["ext-modules"]
    sources = next(module["sources"] for module in modules if module["name"] == "robot_bench._adapter_firmware")
    shutil.copytree(ROOT / "adapter_fw", folder / "adapter_fw")
    (folder / planted.path).write_text(changed(planted), encoding="utf-8")
    whole, built = folder / "whole.cpp", folder / "firmware.so"
    # As one unit: the headers are read once, which is most of the work.
    whole.write_text("".join(f'#include "{source}"\n' for source in sources), encoding="utf-8")
    subprocess.run([*COMPILE, "-shared", whole, "-o", built], cwd=folder, check=True)
    return built


def program(planted: Planted, name: str, folder: Path) -> Path:
    """Return a program of the BluePill with the error, as an ELF."""
    from robot_bench.firmware.build import HERE, build_elf
    from robot_bench.firmware.build import PROGRAMS as SOURCES

    shutil.copytree(HERE, folder / "src", ignore=shutil.ignore_patterns("*.elf", "__pycache__", "*.py"))
    (folder / "src" / Path(planted.path).name).write_text(changed(planted), encoding="utf-8")
    built = folder / f"{name}.elf"
    build_elf(SOURCES[name], folder=folder / "src", linker_script="f103c8.ld", output=built)
    return built


def _import_instead(path: str, text: str, folder: Path) -> None:
    """Import a module's changed text in its place, in this process."""
    name, file = path.removesuffix(".py").replace("/", "."), folder / "changed.py"
    file.write_text(text, encoding="utf-8")

    class Finder:
        @staticmethod
        def find_spec(wanted: str, *_: object) -> ModuleSpec | None:
            return importlib.util.spec_from_file_location(name, file) if wanted == name else None

    sys.meta_path.insert(0, Finder)  # type: ignore[arg-type]  # all that it needs


def run_planted(planted: Planted, experiments: Sequence[str], folder: Path) -> dict[str, list[str]]:
    """Return which figures of which experiments tell of an error, in this process, which it spoils."""
    if planted.path.endswith(".py"):
        _import_instead(planted.path, changed(planted), folder)
    from robot_bench import adapter
    from robot_bench.experiments.validation.experiments import EXPERIMENTS
    from robot_bench.experiments.validation.trials import Variant, run_trials
    from robot_bench.report.make import Files

    if planted.path.startswith("adapter_fw/"):
        planted_library = str(library(planted, folder))
        adapter.built = lambda _: planted_library  # type: ignore[attr-defined]
    found: dict[str, list[str]] = {}
    for name in experiments or EXPERIMENTS:
        experiment = EXPERIMENTS[name]
        settings: list[tuple[str, str]] = []
        if planted.path.startswith(PROGRAMS):
            own = folder / name
            own.mkdir()
            settings = [("firmware", str(program(planted, experiment.load().firmware.stem, own)))]
        variant = Variant(*planted.variant, "kinematic")
        results = run_trials(
            [experiment], [variant], folder / "runs", settings=settings, in_processes=_here, files=Files.SUMMARY
        )
        found[name] = sorted({failure.what for result in results for failure in result.failures})
    return found


def _here(job: Callable[..., dict[str, object]], count: int, on_done: Callable[[int, dict[str, object]], None]) -> bool:
    for number in range(count):
        on_done(number, job(number, lambda: None))
    return True


def figures_that_report(planted: Planted, experiments: Sequence[str]) -> dict[str, list[str]]:
    """Return which figures of which experiments tell of an error, found in a process of its own."""
    words = [planted.path, planted.old, planted.new, *planted.variant, *experiments]
    # A module is replaced before it is imported; a forked Python has imported it.
    python = sys.executable if planted.path.endswith(".py") else forked_python()
    done = subprocess.run(
        [python, "-m", __spec__.name, "--one", json.dumps(words)], cwd=ROOT, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def main() -> int:
    """Plant errors and print what told of them; 1 where one was not noticed by what should."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("row", nargs="*", type=int, help="numbers of rows, from 1; none: all")
    parser.add_argument("--file")
    parser.add_argument("--old")
    parser.add_argument("--new")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        path, old, new, mode, core, *names = json.loads(asked.one)
        with tempfile.TemporaryDirectory() as folder:
            found = run_planted(Planted("", path, old, new, "", "", (mode, core)), names, Path(folder))
        print(json.dumps(found))  # noqa: T201 - its result
        return 0
    if asked.file:
        ways = (FIRMWARE,) if asked.file.startswith("adapter_fw/") else (MODEL, DIRECT)
        for way in ways:
            for name, figures in figures_that_report(
                Planted("", asked.file, asked.old, asked.new, "", "", way), []
            ).items():
                print(f"{' '.join(way):17} {name:16} {'; '.join(figures)}")  # noqa: T201
        return 0
    missed = 0
    for number, row in enumerate(PLANTED, start=1):
        if asked.row and number not in asked.row:
            continue
        figures = figures_that_report(row, [row.experiment])[row.experiment]
        missed += row.figure not in figures
        verdict = "noticed" if row.figure in figures else "NOT NOTICED"
        print(f"{number:3} {verdict:9} {row.error}: {row.experiment}: {'; '.join(figures)}", flush=True)  # noqa: T201
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
