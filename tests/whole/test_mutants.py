"""tools/mutants: each kind of change is made, where it may be; tests that do not look are told from those that do."""

import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tools.mutants import changes, figures, ledger
from tools.mutants.changes import ChangeError
from tools.mutants.judge import Judge, MutantOutcome, MutantStatus
from tools.mutants.languages import c_source, python_source
from tools.mutants.ledger import Ledger
from tools.mutants.mutant import SourceMutant
from tools.mutants.native_lines import NativeLines
from tools.mutants.natives import Natives
from tools.mutants.nearest import Nearest, cheapest_first
from tools.mutants.tree import Tree

ROOT = Path(__file__).parents[2]


def made(text: str, path: str = "p2os/part.py") -> set[tuple[str, str]]:
    make = python_source.mutants if path.endswith(".py") else c_source.mutants
    return {(mutant.kind, mutant.text.decode().strip()) for mutant in make(path, text.encode())}


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a < b", {("comparison", "a <= b"), ("comparison", "a >= b")}),
        ("a is not b", {("comparison", "a is b")}),
        ("(a)  not  in  (b)", {("comparison", "(a)  in  (b)")}),
        ("x = 10", {("constant", "x = 11"), ("constant", "x = 9")}),
        ("x = 0.5", {("constant", "x = 1.0"), ("constant", "x = 0.25")}),
        ("x = True", {("constant", "x = False")}),
        ("x = -y", {("sign", "x = y")}),
        ("x = a + b", {("sign", "x = a - b")}),
        ("x = a // b", {("sign", "x = a * b")}),
        ("x += a", {("sign", "x -= a"), ("dropped", "pass")}),
        ("x = f(a) + 'text'", set()),
        ("x: Left | Right = y", set()),
        ("Both = Left | Right", set()),
        ("self.x = y", {("dropped", "pass")}),
        ("stop(now)", {("dropped", "pass")}),
        ("x = max(a, b)", {("function", "x = min(a, b)")}),
        ("x = a if b else c", {("branches", "x = a if (not (b)) else c")}),
        ("'''Says 1 < 2.'''", set()),
        ("@dataclass(frozen=True)\nclass A:\n    x: int", set()),
        ("if TYPE_CHECKING:\n    x = 1", set()),
        ("a and b", {("and or", "(a or b)"), ("check left out", "True and b"), ("check left out", "a and True")}),
        ("a or b", {("and or", "(a and b)"), ("check left out", "False or b"), ("check left out", "a or False")}),
    ],
)  # fmt: skip
def test_python_is_changed_so(text: str, wanted: set[tuple[str, str]]) -> None:
    assert made(text) == wanted


def test_checks_that_follow_each_other_change_places() -> None:
    text = "def f(a, b):\n    if a:\n        return b\n    if b:\n        return a\n    raise a"
    orders = [changed for kind, changed in made(text) if kind == "order"]
    assert orders == ["def f(a, b):\n    if b:\n        return a\n    if a:\n        return b\n    raise a"]
    text = "if a:\n    x = y\nelif b:\n    x = z\nelse:\n    x = w"
    assert ("order", "if b:\n    x = z\nelif a:\n    x = y\nelse:\n    x = w") in made(text)


def test_columns_are_counted_in_bytes() -> None:
    assert made("x = f('µ', a < b)") == {("comparison", f"x = f('µ', a {op} b)") for op in ("<=", ">=")}


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("int x = a < b;", {("comparison", "int x = a <= b;"), ("comparison", "int x = a >= b;")}),
        ("std::array<int, N> x;", set()),
        ("int x = 0x10u;", {("constant", "int x = 17u;"), ("constant", "int x = 15u;")}),
        ("int x = 1'000;", {("constant", "int x = 1001;"), ("constant", "int x = 999;")}),
        ("bool x = a && !b;", {("and or", "bool x = a || !b;"), ("sign", "bool x = a && b;")}),
        ("int x = a - -b;", {("sign", "int x = a + -b;"), ("sign", "int x = a - b;")}),
        ("x = y; z += y;", {("dropped", "x = y; ;"), ("sign", "x = y; z -= y;")}),
        ("// 1 < 2\n/* 1 */ #include <a>", set()),
        ("#if VERSION > 2\n#define MOST 7", {("constant", f"#if VERSION > 2\n#define MOST {n}") for n in (6, 8)}),
        ('const char *x = "1 < 2";', set()),
        ("{ if (a || b) stop(); }", {
            ("branches", "{ if (!(a || b)) stop(); }"), ("and or", "{ if (a && b) stop(); }"),
        }),
    ],
)  # fmt: skip
def test_c_is_changed_so(text: str, wanted: set[tuple[str, str]]) -> None:
    assert made(text, "adapter_fw/core/part.cpp") == wanted


def test_checks_in_c_that_follow_each_other_change_places() -> None:
    text = "int f() { if (a) { return 1; } if (b) return 2; if (c) g(); return 3; }"
    orders = [changed for kind, changed in made(text, "part.c") if kind == "order"]
    assert orders == ["int f() { if (b) return 2; if (a) { return 1; } if (c) g(); return 3; }"]


def test_only_what_python_compiles_to_something_else_is_another_program() -> None:
    sound = b"def f(a):\n    return a < 1\n"
    assert not python_source.is_other_program(sound, b"def f(a):\n\n    # said\n    return (a < 1)\n")
    assert not python_source.is_other_program(sound, b"def f(a):\n    return a <\n")
    assert python_source.is_other_program(sound, b"def f(a):\n    return a <= 1\n")


def git(folder: Path, *words: str) -> None:
    subprocess.run(
        ["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=folder, check=True, capture_output=True
    )


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "p2os").mkdir()
    (tmp_path / "p2os" / "part.py").write_text("x = 1\ny = 2\nz = 3\n")
    git(tmp_path, "init")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "first")
    monkeypatch.setattr(changes, "ROOT", tmp_path)
    return tmp_path


def test_only_the_lines_that_differ_from_a_commit_are_changed(checkout: Path) -> None:
    (checkout / "p2os" / "part.py").write_text("x = 1\ny = 5\nz = 3\n")
    (checkout / "p2os" / "new.py").write_text("w = 7\n")
    (checkout / "note.txt").write_text("1 < 2\n")
    found = changes.mutants_of(changes.since("HEAD"), checkout)
    assert {mutant.before for mutant in found} == {"y = 5", "w = 7"}
    assert {mutant.first_line for mutant in found if mutant.before == "y = 5"} == {2}


def test_what_another_branch_has_gone_on_with_is_not_changed(checkout: Path) -> None:
    git(checkout, "checkout", "-b", "other")
    (checkout / "p2os" / "part.py").write_text("x = 1\ny = 2\nz = 9\n")
    git(checkout, "commit", "-am", "other")
    git(checkout, "checkout", "-")
    (checkout / "p2os" / "part.py").write_text("x = 4\ny = 2\nz = 3\n")
    git(checkout, "commit", "-am", "ours")
    found = changes.mutants_of(changes.since("other"), checkout)
    assert {mutant.before for mutant in found} == {"x = 4"}


@pytest.mark.parametrize("commit", ["nowhere", "--output=/tmp/x"])
def test_what_is_no_commit_is_refused(checkout: Path, commit: str) -> None:
    with pytest.raises(ChangeError, match="git knows no commit"):
        changes.since(commit)


@pytest.mark.parametrize("name", ["p2os/nothing.py", "p2os/part.txt"])
def test_what_is_no_file_of_ours_is_refused(checkout: Path, name: str) -> None:
    (checkout / "p2os" / "part.txt").write_text("1")
    with pytest.raises(ChangeError):
        changes.files([name])


def test_a_fault_that_was_put_down_is_changed_where_it_stands_once(checkout: Path) -> None:
    row = {"path": "p2os/part.py", "before": "y = 2", "after": "y = 3"}
    (mutant,) = changes.planted([row])
    assert (mutant.first_line, mutant.before, mutant.after) == (2, "y = 2", "y = 3")
    assert mutant.text == b"x = 1\ny = 3\nz = 3\n"
    for wrong, said in (
        ({"before": "y = 4"}, "has 'y = 4' 0 times"),
        ({"before": " = "}, "has ' = ' 3 times"),
        ({"path": "p2os/nothing.py"}, "no code of a package"),
    ):
        with pytest.raises(ChangeError, match=said):
            changes.planted([row | wrong])


def test_every_fault_that_was_put_down_stands_in_its_file() -> None:
    rows = tomllib.loads((ROOT / "tools/mutants/planted.toml").read_text())["fault"]
    assert len(changes.planted(rows)) == len(rows) >= 10


def in_functions(path: str) -> list[int]:
    """Return lines of a file that only a call runs."""
    lines = (ROOT / path).read_text(encoding="utf-8").splitlines()
    return [number for number, text in enumerate(lines, 1) if text.startswith("        return ")]


@pytest.mark.slow  # reads what every file of tests imports
def test_the_nearest_tests_are_those_of_the_mirror_then_those_that_ran_the_line() -> None:
    by_name = Nearest(ROOT, {})
    inside, below, last = in_functions("p2os/client/link.py")[:3]
    assert by_name.of("p2os/client/link.py", inside)[0] == "tests/p2os/client/test_link.py"
    assert by_name.of("adapter_fw/core/app/text.cpp", 1)[0].startswith("tests/adapter_fw/")
    walk, beside = by_name.of("bluepill_sim/extension/source/devices/tim.c", 1)[:2]
    assert walk == "tests/bluepill_sim/peripherals/walks/test_tim_walks.py"
    assert beside.startswith("tests/bluepill_sim/peripherals/tim")
    of_no_name = by_name.of("bluepill_sim/extension/source/devices/listener.c", 1)
    assert all(name.startswith("tests/bluepill_sim/peripherals/walks/") for name in of_no_name[:9])
    in_order = by_name.of("bluepill_sim/extension/source/interpreter/lower.c", 1)
    assert in_order[0].startswith("tests/bluepill_sim/core/")
    # What is loaded by a name is imported by nobody: what walks the folder above it, then who has its folder's name.
    model = "p2os/pioneer/body/mujoco/model.py"
    walks, *others = by_name.of(model, in_functions(model)[0])
    assert walks.startswith("tests/p2os/pioneer/body/walks/")
    assert "tests/p2os/pioneer/body/test_body_mujoco.py" in others[:5]
    ran = {
        "tests/whole/test_plugins.py": frozenset({inside}),
        "tests/p2os/client/test_link.py": frozenset({below, last}),
    }
    counted = Nearest(ROOT, {"p2os/client/link.py": ran})
    for line, first in ((inside, "tests/whole/test_plugins.py"), (below, "tests/p2os/client/test_link.py")):
        found = counted.of("p2os/client/link.py", line)
        rest = [name for name in by_name.of("p2os/client/link.py", inside) if name != first]
        assert found[0] == first
        assert [*found[1:]] == rest[:4]
    # Run by an import: who imports it may look at what it has made, and run no line of it.
    assert counted.of("p2os/client/link.py", 1) == by_name.of("p2os/client/link.py", 1)
    assert "tests/p2os/protocol/test_protocol_page.py" in counted.of("p2os/protocol/command_table.py", 1)


def test_a_file_of_tests_says_by_its_helpers_and_its_data_too(tmp_path: Path) -> None:
    folder = tmp_path / "tests" / "walks"
    folder.mkdir(parents=True)
    (tmp_path / "tests" / "machine.py").write_text("x = 1\n", encoding="utf-8")
    for name, text in (
        ("test_one.py", "from tests.walks.approved import judge\n"),
        ("test_other.py", "import pytest\n"),
        ("approved.py", "from tests.walks.walker import Walker\n"),
        ("walker.py", "from tests.machine import x\n"),
        ("approved.json", "{}"),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    nearest = Nearest(tmp_path, {})
    beside = ("approved.json", "approved.py", "test_one.py", "walker.py")
    assert nearest.made_of("tests/walks/test_one.py") == tuple(f"tests/walks/{name}" for name in beside)
    others = ("approved.json", "test_other.py")
    assert nearest.made_of("tests/walks/test_other.py") == tuple(f"tests/walks/{name}" for name in others)


def test_near_to_a_file_that_no_test_names_is_who_tests_what_it_imports(tmp_path: Path) -> None:
    for name, text in (
        ("pack/verbs/check.py", "def f():\n    from pack.judge import a, b\n    import other.thing\n"),
        ("tests/pack/test_one.py", "from pack.judge import a\n"),
        ("tests/pack/test_other.py", "from pack.judge import a, b\n"),
        ("tests/whole/test_third.py", "import other.thing\n"),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    nearest = Nearest(tmp_path, {})
    assert nearest.of("pack/verbs/check.py", 2) == ("tests/pack/test_other.py", "tests/pack/test_one.py")
    assert nearest.of("pack/verbs/gone.py", 1) == ()


def test_what_modules_declare_is_asked_first_about_a_line_outside_functions(tmp_path: Path) -> None:
    code = "LIMIT = 3\n\n\ndef held(\n    most: int = LIMIT,\n) -> int:\n    return most\n"
    shows = "from tests.tools.suite.declared import declared_of\n"
    files = {
        "pack/verbs/check.py": code,
        "tests/pack/verbs/test_check.py": "from pack.verbs import check\n",
        "tests/pack/verbs/test_near.py": f"{shows}TRACE = declared_of(f'{{0}}')\n",
        "tests/pack/test_named.py": f'{shows}TRACE = declared_of("pack.verbs")\n',
        "tests/pack/test_third.py": shows,
        "tests/other/verbs/test_else.py": f'{shows}TRACE = declared_of("pack.verbs")\n',
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    nearest = Nearest(tmp_path, {})
    own = "tests/pack/verbs/test_check.py"
    for line in (1, 4, 5, 6):
        assert nearest.of("pack/verbs/check.py", line) == (
            "tests/pack/test_named.py", "tests/pack/verbs/test_near.py", own,
        ), line  # fmt: skip
    assert nearest.of("pack/verbs/check.py", 7) == (own,)


def test_the_nearest_tests_come_first_but_for_one_that_takes_much_longer() -> None:
    files = ("a", "b", "c")
    assert cheapest_first(files, {}) == files
    assert cheapest_first(files, {"a": 1.0, "b": 0.2, "c": 0.2}) == ("b", "a", "c")
    assert cheapest_first(files, {"a": 0.5, "b": 0.2, "c": 0.2}) == files
    assert cheapest_first(files, {"a": 9.0}) == ("b", "c", "a")


def mutant(text: str = "x = 1") -> SourceMutant:
    return next(python_source.mutants("p2os/part.py", text.encode()))


def test_what_was_judged_is_there_after_a_run_that_was_cut(tmp_path: Path) -> None:
    file = tmp_path / "judged.jsonl"
    one, other, asked = mutant(), mutant("x = 3"), {"tests/a.py": "1", "tests/b.py": "2"}
    noticed = MutantOutcome(verdict=MutantStatus.NOTICED, by="tests/a.py::test", seconds=1.5)
    book = Ledger(file)
    book.add(one, asked, MutantOutcome(verdict=MutantStatus.SURVIVED))
    book.add_sound("tree", {"tests/a.py::test": 0.5, "tests/a.py::other": None})
    book.add(other, asked, noticed)
    book.add_lasted({"tests/a.py": 1.25})
    whole = file.read_bytes()
    for end in range(0, len(whole) + 1, 7):
        file.write_bytes(whole[:end])
        resumed = Ledger(file)
        resumed.add(mutant("x = 5"), asked, MutantOutcome(verdict=MutantStatus.TIMED_OUT, by="tests/a.py::loop"))
        again = Ledger(file)
        assert again.judgement(mutant("x = 5"), asked) is not None
        assert again.judgement(other, asked) in {None, noticed}
    assert again.judgement(one, asked) == MutantOutcome(verdict=MutantStatus.SURVIVED)
    assert again.sound("tree") == {"tests/a.py::test": 0.5, "tests/a.py::other": None}
    assert again.sound("other") == {}
    file.write_bytes(whole)
    assert Ledger(file).lasted == {"tests/a.py": 1.25}


def test_what_was_judged_holds_until_the_tests_change_that_have_judged_it(tmp_path: Path) -> None:
    one, other, made = mutant(), mutant("x = 3"), mutant("x = 5")
    asked = {"tests/a.py": "1", "tests/b.py": "2"}
    book = Ledger(tmp_path / "judged.jsonl")
    survived = MutantOutcome(verdict=MutantStatus.SURVIVED)
    noticed = MutantOutcome(verdict=MutantStatus.NOTICED, by="tests/a.py::test")
    same = MutantOutcome(verdict=MutantStatus.NO_MUTANT)
    for each, judgement in ((one, survived), (other, noticed), (made, same)):
        book.add(each, asked, judgement)
    for now, of_one, of_other in (
        (asked, survived, noticed),
        (asked | {"tests/b.py": "3"}, None, noticed),
        (asked | {"tests/c.py": "1"}, None, noticed),
        (asked | {"tests/a.py": "3"}, None, None),
        ({"tests/b.py": "2"}, None, None),
    ):
        assert [book.judgement(each, now) for each in (one, other, made)] == [of_one, of_other, same]
    assert book.judgement(mutant("x = 7"), asked) is None


def test_how_long_tests_take_is_noted_anew_where_it_has_changed(tmp_path: Path) -> None:
    file = tmp_path / "judged.jsonl"
    book = Ledger(file)
    for seconds, noted in ((1.0, 1.0), (2.1, 1.0), (2.2, 2.2), (1.1, 2.2), (1.0, 1.0), (0.0, 0.0), (0.1, 0.0)):
        book.add_lasted({"tests/a.py": seconds})
        assert (book.lasted, Ledger(file).lasted) == ({"tests/a.py": noted},) * 2, seconds


def test_the_list_of_survivors_is_written_and_read_back(tmp_path: Path) -> None:
    file = tmp_path / "survivors.toml"
    one = mutant('x = f(1, "µ\\n")')
    rows = {("p2os/a.py", "x = 1", "x = 2"): "because"}
    ledger.write_survivors(ledger.with_new(rows, [one]), file)
    assert ledger.survivors(file) == {**rows, one.row: ""}
    ledger.write_survivors(ledger.with_new(ledger.survivors(file), [one]), file)
    assert len(ledger.survivors(file)) == 2


def test_every_row_of_the_list_is_a_mutant_of_what_stands_there() -> None:
    rows = ledger.survivors()
    made = {each.row for each in changes.mutants_of(dict.fromkeys(sorted({path for path, _, _ in rows})))}
    assert sorted(rows.keys() - made) == [], "the line has changed: judge it again, or drop the row"


def test_the_interval_is_that_of_wilson() -> None:
    low, high = figures.interval(9, 10)  # 0.5958 to 0.9821, by R's binom.wilson
    assert (round(low, 4), round(high, 4)) == (0.5958, 0.9821)
    assert figures.interval(0, 0) == (0.0, 1.0)


PART = """\
def is_far(distance):
    if distance >= 10:
        return True
    return False


def spin():
    count = 0
    while count < 3:
        count += 1
    return count
"""


PROJECT = {
    "pyproject.toml": (
        "[tool.setuptools]\next-modules = []\n[tool.pytest.ini_options]\nmarkers = ['slow', 'soak', 'hardware']\n"
    ),
    "conftest.py": (
        "from hypothesis import settings\nsettings.register_profile('unshrunk')\n"
        "def pytest_collection_modifyitems(items):\n    items.sort(key=lambda item: item.path)\n"
    ),
    "test_far.py": (
        "from part import is_far\n"
        "def test_far():\n    assert is_far(11) and not is_far(2)\n"
        "def test_broken():\n    assert False\n"
    ),
    "test_more.py": "from part import is_far\ndef test_more():\n    assert is_far(10)\n",
    "test_long.py": (
        "import pytest\nfrom part import is_far\n@pytest.mark.slow\ndef test_long():\n    assert is_far(10)\n"
    ),
    "test_ended.py": "from part import is_far\nimport os\ndef test_ended():\n    is_far(10) or os._exit(9)\n",
    "test_kept.py": "def test_kept():\n    kept = bytearray(80 << 20)\n    while True:\n        pass\n",
    "test_slow.py": (
        "import time\nfrom part import spin\ndef test_slow():\n    spin()\n"
        "    while time.process_time() < 1.0:\n        pass\n"
    ),
    "test_spin.py": "from part import spin\ndef test_spin():\n    assert spin() == 3\n",
}


#: What the copy has of the tool: it runs there.
OURS = ("forks", "outcome")


LIBRARY = """\
#include "limit.h"
int near_ones, far_ones;
int is_far(int distance)
{
    if (is_over(distance)) {
        return ++far_ones;
    }
    near_ones += 2;
    return 0;
}
"""
OF_LIBRARY = {
    "pack/far.c": LIBRARY,
    "pack/limit.h": "static int is_over(int distance)\n{\n    return distance > 9;\n}\n",
    "pyproject.toml": (
        "[tool.pytest.ini_options]\nmarkers = ['slow', 'soak', 'hardware']\n"
        "[tool.setuptools]\next-modules = [{name = 'pack._far', sources = ['pack/*.c']}]\n"
    ),
    "conftest.py": PROJECT["conftest.py"],
    "tests/test_far.py": (
        "import ctypes\nfrom pathlib import Path\n"
        "def test_far():\n    assert ctypes.CDLL(str(Path('pack/_far.so').resolve())).is_far(11)\n"
        "def test_that_fails():\n    assert False\n"
    ),
}


@pytest.mark.slow
def test_gcov_counts_the_lines_in_c_that_a_file_of_tests_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in OF_LIBRARY.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    git(tmp_path, "init")
    monkeypatch.setattr("tools.mutants.nearest.TESTS_OF_C", {"pack": ("tests",)})
    native = NativeLines(tmp_path)
    native.count(Nearest(tmp_path, {}), ["pack/part.py"], 1)
    assert (native.lines(), capsys.readouterr().err) == ({}, "")
    native.count(Nearest(tmp_path, {}), ["pack/far.c"], 2)
    far, ran = "tests/test_far.py", {5, 6}
    assert NativeLines(tmp_path).lines() == native.lines()
    assert native.lines()["pack/limit.h"] == {"": {1, 3}, far: {1, 3}}
    assert {*native.lines()["pack/far.c"]} == {"", far}
    assert native.lines()["pack/far.c"][far] >= ran
    assert native.lines()["pack/far.c"][""] >= ran | {8}
    assert 8 not in native.lines()["pack/far.c"][far]
    assert "lines in C: 1 of 1 files of tests" in capsys.readouterr().err
    # What has not changed is not counted again, and what was counted on another text is not known.
    counted: list[str] = []
    monkeypatch.setattr("tools.mutants.native_lines._counters", lambda *_: None)

    def note(_: object, name: str) -> dict[str, tuple[list[int], list[int]]]:
        counted.append(name)
        return {}

    monkeypatch.setattr("tools.mutants.native_lines._counted", note)
    (tmp_path / "tests" / "test_near.py").write_text("def test_near():\n    assert True\n")
    native.count(Nearest(tmp_path, {}), ["pack/far.c"], 1)
    assert counted == ["tests/test_near.py"]
    (tmp_path / "pack" / "far.c").write_text(f"\n{LIBRARY}")
    assert {*native.lines()} == {"pack/limit.h"}
    native.count(Nearest(tmp_path, {}), ["pack/far.c"], 1)
    assert counted[1:] == [far, "tests/test_near.py"]
    assert native.lines() == {}
    (tmp_path / far).write_text("")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OSError, match="gcov"):
        native.count(Nearest(tmp_path, {}), ["pack/far.c"], 1)


def test_of_a_line_in_c_those_are_asked_that_have_run_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"tests/test_{letter}.py" for letter in "abcdefg"]
    (tmp_path / "tests").mkdir()
    for name in names:
        (tmp_path / name).write_text("")
    monkeypatch.setattr("tools.mutants.nearest.TESTS_OF_C", {"pack/far.c": (names[1], names[0])})
    a, b, c, d, *_ = names
    ran = {"": {3, 4, 20}, a: {3, 20}, b: {4}, c: {3}, d: {3, 4, 20}, "tests/test_gone.py": {3}}
    nearest = Nearest(tmp_path, {"pack/far.c": {name: frozenset(lines) for name, lines in ran.items()}})
    assert nearest.of("pack/far.c", 3) == (a, d, c, b), "whom the table names first, then who runs most of the file"
    assert nearest.of("pack/far.c", 4) == (b, d, a)
    assert nearest.of("pack/far.c", 7) == (b, d, a), "a line further on in the statement"
    assert nearest.of("pack/far.c", 8) == (b, a), "no code: those of the table alone"
    assert nearest.of("pack/far.c", 20) == (a, d, b)
    assert nearest.of("pack/other.c", 3) == ()
    assert nearest.of_package_in_c("pack") == (a, b)
    assert nearest.of_package_in_c("pac") == ()


@pytest.fixture
def judge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Judge]:
    """A project of one module: boundaries that are looked at or not, a loop, a test that fails without a change."""
    root, scratch = tmp_path / "root", tmp_path / "scratch"
    ours = {f"tools/mutants/{name}.py": (ROOT / f"tools/mutants/{name}.py").read_text() for name in OURS}
    (root / "tools" / "mutants").mkdir(parents=True)
    for name, text in {**PROJECT, "part.py": PART, **ours}.items():
        (root / name).write_text(text)
    scratch.mkdir()
    git(root, "init")
    tree = Tree(root, tmp_path / "copy")
    monkeypatch.setattr("tools.mutants.judge.TEST_LIMIT_S", 1.0)
    monkeypatch.setattr("tools.mutants.judge.SOUND_PART", 0.9)
    found = Judge(tree, scratch, Natives(tree.folder, scratch, ["part.py"], tmp_path / "kept"))
    yield found
    found.end()


def of_part(after: str) -> SourceMutant:
    return next(each for each in python_source.mutants("part.py", PART.encode()) if each.after == after)


@pytest.mark.slow
def test_a_mutant_that_tests_look_at_is_noticed_and_another_survives(judge: Judge, tmp_path: Path) -> None:
    boundary, opposite = of_part("if distance > 10:"), of_part("if distance < 10:")
    assert judge.judged(boundary, ["test_far.py"]).verdict is MutantStatus.SURVIVED
    assert judge.sound_s("test_far.py::test_broken") is None
    noticed = judge.judged(opposite, ["test_far.py"])
    assert (noticed.verdict, noticed.by) == (MutantStatus.NOTICED, "test_far.py::test_far")
    assert judge.judged(opposite, []).verdict is MutantStatus.UNTESTED
    # Those that stand further away are asked last, and after what has no tests that pass.
    far = judge.judged(boundary, ["test_far.py", "test_spin.py", "test_more.py"])
    assert (far.verdict, far.by) == (MutantStatus.NOTICED, "test_more.py::test_more")
    # Those that are long are asked when the others have not noticed anything.
    last = judge.judged(boundary, ["test_long.py", "test_spin.py"])
    assert (last.verdict, last.by) == (MutantStatus.NOTICED, "test_long.py::test_long")
    ended = judge.judged(boundary, ["test_ended.py"])
    assert (ended.verdict, ended.by) == (MutantStatus.NOTICED, "test_ended.py::test_ended")
    assert {(tmp_path / name / "part.py").read_text() for name in ("root", "copy/tree")} == {PART}


@pytest.mark.slow
def test_what_keeps_more_memory_than_it_may_is_ended(judge: Judge, monkeypatch: pytest.MonkeyPatch) -> None:
    assert judge.sound_s("test_spin.py::test_spin") is not None
    monkeypatch.setattr("tools.mutants.judge.TEST_LIMIT_S", 15.0)
    monkeypatch.setattr("tools.mutants.judge.MOST_KB", 80 << 10)
    began = time.process_time()
    assert judge.sound_s("test_kept.py::test_kept") is None
    assert time.process_time() - began < 5.0, "before its time of a processor"


@pytest.mark.slow
def test_an_endless_loop_is_noticed_by_its_time_where_the_sound_program_is_soon_done(judge: Judge) -> None:
    loop = of_part("pass")
    found = judge.judged(loop, ["test_spin.py"])
    assert (found.verdict, found.by) == (MutantStatus.TIMED_OUT, "test_spin.py::test_spin")
    assert judge.judged(loop, ["test_slow.py"]).verdict is MutantStatus.UNDECIDED  # it lasts long without a change
    found = judge.judged(loop, ["test_slow.py", "test_spin.py"])
    assert (found.verdict, found.by) == (MutantStatus.TIMED_OUT, "test_spin.py::test_spin"), "the others are asked"


@pytest.mark.slow
def test_no_other_test_begins_when_the_time_is_over(judge: Judge, monkeypatch: pytest.MonkeyPatch) -> None:
    boundary = of_part("if distance > 10:")
    monkeypatch.setattr("tools.mutants.judge.BEGIN_S", 0.0)
    found = judge.judged(boundary, ["test_spin.py", "test_more.py"])  # one test runs, of the file that is named first
    assert found.verdict is MutantStatus.SURVIVED


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "name files, or a commit by --since, or a --sample, or take what is --planted"),
        (["p2os", "--since", "HEAD"], "name files, or a commit by --since, or a --sample, or take what is --planted"),
        (["--sample", "none"], "no sample is named none (there are ci, sequences, whole)"),
        (["p2os/nothing.py"], "p2os/nothing.py is not there (hint: a path from the project's folder)"),
        (["p2os/client", "--count", "0"], "invalid"),
    ],
)
def test_wrong_words_are_said_in_a_line_and_2(
    words: list[str], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from tools.mutants.__main__ import main

    monkeypatch.setattr(sys, "argv", ["mutants", *words])
    try:
        code = main()
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 2
    assert said in capsys.readouterr().err.splitlines()[-1]
