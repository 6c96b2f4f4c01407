"""Who decides that code of a file is executed, what an answer holds for, and what counts as installed."""

import importlib
import io
import json
import pickle
import py_compile
import sys
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import pytest

from simbase import user_classes
from simbase.entry_points import installed_points
from simbase.errors import FileError, UsageError
from simbase.installation import installed_needs
from simbase.trust import Code, Trust, UntrustedError, fingerprint, fingerprint_of, own_code, store
from simbase.user_classes import OF_USERS, find_class

WHERE = "a.toml:4: body"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with `mine.py`, which writes a canary when it is executed; the user has said nothing yet."""
    for name in ("STATE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name.lower()))
    here = tmp_path / "here"
    here.mkdir()
    text = f"from pathlib import Path\nPath({str(tmp_path / 'canary')!r}).write_text('x')\nclass C: pass\n"
    (here / "mine.py").write_text(text)
    monkeypatch.delitem(sys.modules, f"{OF_USERS}mine", raising=False)
    return here


def loaded(name: str) -> object:
    return find_class(name, what="part", group="p2os.parts", known=())


def was_executed(folder: Path) -> bool:
    canary = folder.parent / "canary"
    found = canary.exists()
    canary.unlink(missing_ok=True)
    return found


def answered(monkeypatch: pytest.MonkeyPatch, words: str, folder: Path) -> str:
    """Return what was asked, `words` being the answer; empty where nothing was."""
    said = Terminal()
    monkeypatch.setattr(sys, "stdin", Terminal(words))
    monkeypatch.setattr(sys, "stderr", said)
    Trust(asks=True).admit("./mine.py:C", folder, WHERE)
    return said.getvalue()


@pytest.mark.parametrize("name", ["mine.py:C", "/mine.py:C", "../here/mine.py:C"])
def test_a_plain_text_is_never_loaded(name: str, folder: Path) -> None:
    with pytest.raises(UntrustedError, match="was not admitted"):
        loaded(str(folder / name))
    assert not was_executed(folder)


def test_a_name_that_is_only_read_is_never_loaded(folder: Path) -> None:
    code = Trust(only_reads=True, everything=True).admit("./mine.py:C", folder, WHERE)
    assert isinstance(code, Code)
    assert code.is_unread
    with pytest.raises(UntrustedError, match=r"a\.toml:4: body: \./mine\.py:C may not be executed"):
        loaded(code)
    assert not was_executed(folder)


def test_nobody_has_said_so_is_a_refusal_in_one_line_with_the_place_and_the_option(folder: Path) -> None:
    with pytest.raises(UntrustedError, match=r"^a\.toml:4: body: \./mine\.py:C is Python code") as caught:
        Trust(asks=True).admit("./mine.py:C", folder, WHERE)  # the input of a test is no terminal
    assert caught.value.exit_code == 2
    assert "--trust" in str(caught.value.hint)
    assert not was_executed(folder)


@pytest.mark.parametrize("name", ["kinematic", "mine", "mine:C", "mine.py", "tcp:127.0.0.1:5"])
def test_what_is_no_class_in_a_file_stays_as_it_is(name: str, folder: Path) -> None:
    assert Trust().admit(name, folder, WHERE) is name
    assert own_code(name, folder) is name


def test_with_trust_it_is_executed_once(folder: Path) -> None:
    for trust in (
        Trust.of(given=True),
        Trust(everything=True),
        Trust(paths=(folder,)),
        Trust(paths=(folder / "mine.py",)),
    ):
        code = trust.admit("./mine.py:C", folder, WHERE)
        sys.modules.pop(f"{OF_USERS}mine", None)
        loaded(code)
        assert was_executed(folder)
        loaded(code)
        assert not was_executed(folder)


def test_trust_in_another_path_is_none(folder: Path) -> None:
    (folder / "mine").mkdir()
    for path in (folder / "other.py", folder / "mine", Path(f"{folder}/min"), folder / "mine.pyx"):
        with pytest.raises(UntrustedError):
            Trust(paths=(path,)).admit("./mine.py:C", folder, WHERE)


@pytest.mark.parametrize("words", ["", "\n", "n\n", "no\n", "yep\n", "Y es\n"])
def test_no_yes_is_no(words: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UntrustedError):
        answered(monkeypatch, words, folder)
    assert store.answers() == frozenset()


def test_yes_is_remembered_until_anything_that_can_be_imported_beside_it_changes(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "helper").mkdir()
    (folder / "helper" / "deep.py").write_text("A = 1\n")
    question = answered(monkeypatch, "y\n", folder)
    assert question.startswith("a.toml:4: body: ./mine.py:C is Python code: ")
    assert "and 1 more file beside it" in question
    for name in ("notes.txt", "a.toml", "helper/__pycache__/deep.cpython-311.pyc", "runs-1/x.py", ".venv/x.py"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("1")
        assert answered(monkeypatch, "n\n", folder) == ""
    moved = folder.rename(folder.parent / "moved")
    assert answered(monkeypatch, "n\n", moved) == ""
    for name, text in (("helper/deep.py", "A = 2\n"), ("mine.py", "class C: pass\n"), ("new.so", ""), ("old.pyc", "")):
        (moved / name).write_text(text)
        assert answered(monkeypatch, "YES\n", moved)
        assert answered(monkeypatch, "n\n", moved) == ""
    (moved / "mine.py").rename(moved / "yours.py")
    with pytest.raises(UntrustedError):
        Trust().admit("yours.py:C", moved, WHERE)
    assert (folder.parent / "state" / "p2os" / "trusted.jsonl").stat().st_mode & 0o077 == 0


def test_an_answer_for_one_file_of_a_folder_is_none_for_another(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "other.py").write_text("class C: pass\n")
    answered(monkeypatch, "y\n", folder)
    with pytest.raises(UntrustedError):
        Trust().admit("other.py:C", folder, WHERE)


@pytest.mark.parametrize("end", ["\n", ""])  # written whole, or cut
def test_a_damaged_memory_forgets_and_loses_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> None:
    kept = folder.parent / "state" / "p2os" / "trusted.jsonl"
    kept.parent.mkdir(parents=True)
    kept.write_text(f'{{"key": 3\n[]\nnull\n{{"other": "x"}}{end}')
    answered(monkeypatch, "y\n", folder)
    assert answered(monkeypatch, "", folder) == ""
    assert len(kept.read_text().splitlines()) == 5
    assert json.loads(kept.read_text().splitlines()[-1])["file"] == str(folder / "mine.py")


def test_a_memory_that_cannot_be_written_asks_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder.parent / "state").write_text("")
    for _ in range(2):
        assert "the next time asks again" in answered(monkeypatch, "y\n", folder)


@pytest.mark.parametrize("variable", ["", "relative/folder"])
def test_a_folder_of_state_that_is_no_whole_path_does_not_count(
    variable: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HOME", str(folder.parent / "home"))
    monkeypatch.setenv("XDG_STATE_HOME", variable)
    answered(monkeypatch, "y\n", folder)
    assert (folder.parent / "home" / ".local" / "state" / "p2os" / "trusted.jsonl").is_file()


def test_the_configuration_names_files_and_folders(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = folder.parent / "config" / "p2os" / "config.toml"
    config.parent.mkdir(parents=True)
    monkeypatch.setenv("HOME", str(folder.parent))
    for path in (str(folder), "~/here", "~/here/mine.py", str(folder.parent)):
        config.write_text(f'other = 1\ntrust = ["/nowhere", "{path}"]\n')
        assert loaded(Trust().admit("./mine.py:C", folder, WHERE))
    config.write_text('trust = ["~/there"]\n')
    with pytest.raises(UntrustedError):
        Trust().admit("./mine.py:C", folder, WHERE)


@pytest.mark.parametrize("text", ['trust = ["here"]', 'trust = "/here"', "trust = [1]", "trust = {}", "trust ="])
def test_a_configuration_that_says_something_else_is_one_line(text: str, folder: Path) -> None:
    config = folder.parent / "config" / "p2os" / "config.toml"
    config.parent.mkdir(parents=True)
    config.write_text(text)
    with pytest.raises(FileError, match=r"config\.toml: ") as caught:
        Trust().admit("./mine.py:C", folder, WHERE)
    assert caught.value.exit_code == 2


def test_what_changes_after_it_was_admitted_is_not_loaded(folder: Path) -> None:
    code = own_code("mine.py:C", folder)
    (folder / "helper.py").write_text("")
    with pytest.raises(UntrustedError, match=r"helper\.py in its folder has changed"):
        loaded(code)
    assert not was_executed(folder)
    loaded(own_code("mine.py:C", folder))
    assert was_executed(folder)
    (folder / "helper.py").write_text("A = 1")
    loaded(own_code("mine.py:C", folder))
    assert was_executed(folder), "another content is loaded anew"


def test_a_class_that_was_admitted_is_found_again_from_a_copy(folder: Path) -> None:
    code = own_code("mine.py:C", folder)
    for copy in (pickle.loads(pickle.dumps(code)), deepcopy(code)):  # noqa: S301 - our own
        assert copy == code
        assert (copy.admitted, copy.named, copy.key) == (code.admitted, "mine.py:C", code.key)
        assert loaded(copy)


def test_bytecode_that_travels_with_a_folder_is_not_executed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "helper.py").write_text("SAID = 'source'\n")
    for name in ("helper", "mine"):
        source = folder / f"{name}.py"
        text = source.read_text()
        source.write_text("SAID = 'bytecode'\nclass C: helper = 'bytecode'\n")
        cached = importlib.util.cache_from_source(str(source))
        py_compile.compile(str(source), cached, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
        source.write_text(text)
    (folder / "mine.py").write_text("import helper\nclass C: helper = helper.SAID\n")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "helper", raising=False)
    made = loaded(own_code("mine.py:C", folder))
    monkeypatch.delitem(sys.modules, "helper")
    assert made.helper == "source"  # type: ignore[attr-defined] # of the class above


def test_a_folder_with_too_many_files_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fingerprint, "MOST_FILES", 2)
    (folder / "a.py").write_text("")
    assert len(fingerprint_of(folder).files) == 2
    (folder / "b.py").write_text("")
    with pytest.raises(UsageError, match="more than 2 files that can be imported"):
        fingerprint_of(folder)


def test_a_folder_with_too_much_is_refused_before_it_is_read(folder: Path) -> None:
    with (folder / "huge.py").open("wb") as file:
        file.truncate(fingerprint.MOST_BYTES + 1)
    with pytest.raises(UsageError, match="more than 256 MiB that can be imported"):
        fingerprint_of(folder)


def test_a_folder_with_too_many_entries_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fingerprint, "MOST_ENTRIES", 2)
    (folder / "a.txt").write_text("")
    assert len(fingerprint_of(folder).files) == 1
    (folder / "b.txt").write_text("")
    with pytest.raises(UsageError, match="more than 2 entries"):
        fingerprint_of(folder)


def test_links_in_a_circle_end(folder: Path) -> None:
    (folder / "again").symlink_to(folder)
    (folder / "package").mkdir()
    (folder / "package" / "part.py").write_text("")
    (folder / "twin").symlink_to(folder / "package")
    assert set(fingerprint_of(folder).files) in (
        {"mine.py", "package/part.py"}, {"mine.py", "twin/part.py"}
    )  # fmt: skip


@pytest.mark.parametrize("name", ["x\0.py:C", f"{'x' * 5000}.py:C", "none.py:C", "./:C.py:C"])
def test_a_file_that_is_not_there_is_one_line(name: str, folder: Path) -> None:
    for code in (
        Trust().admit(name, folder, WHERE),
        own_code(name, folder),
        Trust(only_reads=True).admit(name, folder, ""),
    ):
        with pytest.raises(UsageError, match="there is no file"):
            loaded(code)


def distribution(home: Path, name: str, module: str, **files: str) -> None:
    """Write the metadata of a distribution that offers a part, and its module."""
    info = home / f"{name}-1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[p2os.parts]\n{name} = {module}:C\n")
    for file, text in files.items():
        (info / file.replace("_json", ".json")).write_text(text)


@pytest.mark.parametrize("entry", ["", ".", "HERE"])
def test_the_current_folder_is_no_installed_package(entry: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distribution(folder, "rogue", "mine")
    distribution(folder, "p2os", "mine")  # it hides nothing that is installed either
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [str(folder) if entry == "HERE" else entry, *sys.path])
    assert "rogue" not in installed_points("p2os.parts")
    assert "simbase" in installed_points("simbase.packages")
    with pytest.raises(UsageError, match="there is no part 'rogue'"):
        loaded("rogue")
    assert not was_executed(folder)


def test_what_the_current_folder_says_it_needs_is_not_loaded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distribution(folder, "rogue", "mine")
    (folder / "rogue-1.dist-info" / "entry_points.txt").write_text("[simbase.packages]\nrogue = mine:C\n")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    assert installed_needs()
    assert not was_executed(folder)


def test_a_module_of_the_current_folder_is_not_that_of_a_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = folder.parent / "site"
    distribution(home, "good", "mine")
    (home / "mine.py").write_text("class C: pass\n")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [str(home), *sys.path])
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    assert "good" in installed_points("p2os.parts")
    monkeypatch.setattr(sys, "path", ["", *sys.path])  # before the package
    importlib.invalidate_caches()
    assert "good" not in installed_points("p2os.parts")
    assert not was_executed(folder)


def test_an_editable_install_is_installed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = folder.parent / "site"
    said = {"url": folder.as_uri(), "dir_info": {"editable": True}}
    distribution(home, "mended", "mine.inner", direct_url_json=json.dumps(said))
    (folder / "mine.py").unlink()
    (folder / "mine").mkdir()
    (folder / "mine" / "inner.py").write_text("class C: pass\n")
    monkeypatch.setattr(sys, "path", [str(home), str(folder), *sys.path])
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    assert "mended" in installed_points("p2os.parts")
    found = json.loads((home / "mended-1.dist-info" / "direct_url.json").read_text())
    (home / "mended-1.dist-info" / "direct_url.json").write_text(json.dumps(found | {"dir_info": {}}))
    importlib.invalidate_caches()
    assert "mended" not in installed_points("p2os.parts")


def test_trust_of_a_program_is_a_flag_or_a_trust(folder: Path) -> None:
    trust = Trust(paths=(folder,))
    assert Trust.of(trust) is trust
    assert Trust.of(given=False) == replace(Trust.of(given=True), everything=False)
    assert user_classes.OF_USERS
