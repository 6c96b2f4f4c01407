"""Every place of a file of a user that could name code, out of the schemas: nothing is executed untrusted.

Each text of each table is set to a class in a file, in each spelling, so that a new key is looked at without a word
here. The file writes a canary when it is executed.
"""

import ast
import contextlib
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pytest

from p2os.cli.main import run as p2os
from p2os.pioneer.serve import fleet_file
from p2os.pioneer.serve.fleet_file import load_fleet
from p2os.toml_file import toml_text
from p2os.toml_schema import Key
from robot_bench.campaign import campaign_file
from robot_bench.campaign.campaign_file import load_campaign
from robot_bench.campaign.variants.shrinking import kept
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.tables import TABLES
from simbase.errors import P2osError
from simbase.trust import UntrustedError
from simbase.user_classes import OF_USERS

ROOT = Path(__file__).parents[3]
#: What may hold a name.
TEXTS = {"any", "text", "texts", "line", "ascii", "list"}
SCENARIO: dict[str, object] = {"firmware": "dodge", "world": "room", "duration_s": 1.0}
FLEET: dict[str, object] = {"robot": [{"port": "tcp:127.0.0.1:0"}]}
CAMPAIGN: dict[str, object] = {"scenario": "dodge", "vary": {"threshold_m": [0.4, 0.5]}}
#: Of a folder of metadata: every group that a name is looked for in.
POINTS = "".join(
    f"[{group}]\nrogue = rogue:C\n"
    for group in ("p2os.bodies", "p2os.adapters", "p2os.controllers", "p2os.parts", "robot_bench.goals")
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, from which Python imports, with code in it and beside it."""
    here = tmp_path / "there" / "here"
    here.mkdir(parents=True)
    for place, name in ((here, "mine"), (here, "rogue"), (here.parent, "mine")):
        canary = f"from pathlib import Path\nPath({str(tmp_path / 'canary')!r}).write_text('x')\nclass C: pass\n"
        (place / f"{name}.py").write_text(canary)
    (here / "rogue.egg-info").mkdir()
    (here / "rogue.egg-info" / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: rogue\nVersion: 1\n")
    (here / "rogue.egg-info" / "entry_points.txt").write_text(POINTS)
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "path", [str(here), "", *sys.path])
    monkeypatch.delitem(sys.modules, f"{OF_USERS}mine", raising=False)
    return here


def spellings(folder: Path) -> dict[str, str]:
    return {
        "beside": "./mine.py:C", "above": "../mine.py:C", "whole": f"{folder}/mine.py:C", "module": "mine:C",
        "point": "rogue",
    }  # fmt: skip


def plausible(key: Key) -> object:
    """Return a value that a key takes, so that no other key than the one in question is refused."""
    number = next(value for value in (key.least, key.above and key.above * 2, key.most, 1.0) if value is not None)
    count = max(key.count, 1)
    by_kind: Mapping[str, object] = {
        "number": number or 1.0, "whole": int(number) or 1, "flag": True, "numbers": [1.0] * count,
        "points": [[1.0] * count], "table": {}, "tables": [], "list": [1], "texts": ["x"],
    }  # fmt: skip
    return key.choices[0] if key.choices else by_kind.get(key.kind, "x")


def placed(base: Mapping[str, object], header: str, row: Mapping[str, object]) -> dict[str, object]:
    """Return a file's table with a row in the table of a header such as `[[goal]] reach`."""
    name = header.strip("[]").split("]")[0]
    kind = header.partition("]] ")[2]
    row = {"kind": kind, **row} if kind else dict(row)
    if not name:
        return {**base, **row}
    if name.endswith(".NAME"):
        return {**base, name.removesuffix(".NAME"): {"room": row}}
    return {**base, name: [row] if header.startswith("[[") else row}


def files(
    base: Mapping[str, object], tables: Mapping[str, Sequence[Key]], value: str
) -> Iterator[tuple[str, Key, dict[str, object]]]:
    """Yield a file for each text of each table, which has the value there."""
    for header, keys in tables.items():
        required = {key.name: plausible(key) for key in keys if key.required and (header or key.name not in base)}
        for key in keys:
            if key.kind in TEXTS:
                given: object = [value] if key.kind in {"list", "texts"} else value
                yield header, key, placed(base, header, {**required, key.name: given})


#: What is read → its table without code, its schema, and who reads it.
READ: Mapping[str, tuple[dict[str, object], Mapping[str, Sequence[Key]], Callable[[Path], object]]] = {
    "scenario": (SCENARIO, TABLES, lambda path: load_scenario(str(path))),
    "fleet": (FLEET, {"": fleet_file.TOP, "[[robot]]": fleet_file.ROBOT}, load_fleet),
    "campaign": (CAMPAIGN, campaign_file.TABLES, load_campaign),
}
#: Tables whose keys are those of others.
OTHERS: Mapping[str, list[dict[str, object]]] = {
    "scenario": [{"sweep": {key: ["VALUE"]}} for key in ("body", "adapter.core", "controller.kind")]
    + [{"part": [{"kind": "sd-card", "on": "SPI1", "select": "PA8", key: "VALUE"}]} for key in ("image", "name")],
    "fleet": [],
    "campaign": [{stage: {"body": "VALUE"}} for stage in ("cheap", "full")] + [{"vary": {"body": ["VALUE"]}}],
}


@pytest.mark.parametrize("spelling", ["beside", "above", "whole", "module", "point"])
@pytest.mark.parametrize("what", list(READ))
def test_no_text_of_any_table_has_code_executed(
    what: str, spelling: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", open("/dev/null"))  # noqa: SIM115, PTH123 - closed with the process
    base, tables, read = READ[what]
    value, path = spellings(folder)[spelling], folder / "file.toml"
    found = [(header, key, table) for header, key, table in files(base, tables, value)]
    found += [("", Key(name="", kind="any"), {**base, **_filled(table, value)}) for table in OTHERS[what]]
    refused = set()
    for header, key, table in found:
        path.write_text(toml_text(table))
        try:
            read(path)
        except P2osError as error:
            if isinstance(error, UntrustedError) and f"file.toml:{_line(path, value)}: " in str(error):
                refused.add((header, key.name))
        if what == "scenario" and (key.group or not header):
            p2os(["check", str(path)])
        assert not (folder.parents[1] / "canary").exists(), f"{header} {key.name} executes {value}"
    groups = {(header, key.name) for header, keys in tables.items() for key in keys if key.group}
    if spelling in {"beside", "above", "whole"}:
        assert refused >= groups, "each place that names code is refused for that, and not for anything else"
    said = capsys.readouterr().out
    if what == "scenario":
        reported = len(groups) + len([row for row in OTHERS[what] if "sweep" in row])
        assert said.count("not checked: code") == (reported if spelling in {"beside", "above", "whole"} else 0)


def _line(path: Path, value: str) -> int:
    return next(n for n, line in enumerate(path.read_text().splitlines(), start=1) if value in line)


def _filled(table: object, value: str) -> dict[str, object]:
    def put(one: object) -> object:
        if isinstance(one, dict):
            return {key: put(item) for key, item in one.items()}
        if isinstance(one, list):
            return [put(item) for item in one]
        return value if one == "VALUE" else one

    assert isinstance(table, dict)
    return {key: put(item) for key, item in table.items()}


@pytest.mark.parametrize("what", list(READ))
def test_the_sweep_knows_the_places_that_name_code(what: str) -> None:
    _, tables, _ = READ[what]
    groups = {(header, key.name) for header, keys in tables.items() for key in keys if key.group}
    wanted = {
        "scenario": {("", "body"), ("[adapter]", "core"), ("[controller]", "kind"), ("[[part]]", "kind")},
        "fleet": {("", "body")}, "campaign": set(),
    }  # fmt: skip
    assert groups == wanted[what]


@pytest.mark.parametrize("spelling", ["beside", "above", "whole"])
def test_trusted_code_is_executed_at_each_place(spelling: str, folder: Path) -> None:
    canary, path = folder.parents[1] / "canary", folder / "file.toml"
    for what, load in (("scenario", load_scenario), ("fleet", load_fleet)):
        base, tables, _ = READ[what]
        for _header, key, table in files(base, tables, spellings(folder)[spelling]):
            if key.group:
                path.write_text(toml_text(table))
                sys.modules.pop(f"{OF_USERS}mine", None)
                with contextlib.suppress(P2osError):  # it lacks the methods of what it is to be
                    load(path if what == "fleet" else str(path), trust=True)  # type: ignore[operator] # one of the two
                assert canary.exists()
                canary.unlink()


#: What reads a file that may name code.
READERS = {
    "load_scenario", "read_scenario", "build_scenario", "load_fleet", "parse_fleet", "load_campaign", "parse_campaign",
    "trial_of", "trial_of_run", "load_parts",
}  # fmt: skip


def test_whoever_reads_such_a_file_says_what_is_trusted() -> None:
    forgotten = []
    for package in ("p2os", "robot_bench", "bluepill_sim", "adapter_sim"):
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            if not any(f"{reader}(" in text for reader in READERS):
                continue
            for call in ast.walk(ast.parse(text)):
                if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in READERS:
                    ships = bool(call.args) and isinstance(call.args[0], ast.Constant)
                    says = any(word.arg == "trust" for word in call.keywords) or any(
                        isinstance(one, ast.Name) and one.id == "trust" for one in call.args
                    )
                    if not ships and not says:
                        forgotten.append(f"{path.relative_to(ROOT)}:{call.lineno}: {call.func.id}")
    assert not forgotten, "\n".join(forgotten)


def test_no_process_of_ours_imports_from_the_current_folder() -> None:
    begun = [
        line
        for package in ("p2os", "robot_bench", "bluepill_sim", "adapter_sim", "simbase")
        for path in (ROOT / package).rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(r"sys\.executable\b.*\"-[cm]\"", line)
    ]
    assert begun
    assert [line for line in begun if '"-P"' not in line] == []


def test_the_process_that_runs_what_was_shrunk_takes_nothing_from_the_current_folder(folder: Path) -> None:
    for name in ("simbase", "typer", "p2os"):
        (folder / f"{name}.py").write_text((folder / "mine.py").read_text())
    found = subprocess.run([*kept._COMMAND, "--version"], capture_output=True, cwd=folder, check=False)
    assert found.returncode == 0, found.stderr
    assert not (folder.parents[1] / "canary").exists()
