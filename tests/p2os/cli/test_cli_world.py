"""`p2os world`: what a person types and gets."""

import json
from pathlib import Path

import pytest

from p2os.cli.main import run
from p2os.pioneer.world import known_worlds, load_world

COMMANDS_THAT_FAIL = [
    (["world", "show", "rooom"], "p2os: no world 'rooom'\nhint: did you mean 'room'?\n"),
    (["world", "show", "room", "--out", "room.jpg"], "hint: --out FILE.svg\n"),
    (["world", "show", "room", "--out", "missing/room.svg"], "no such file or directory\n"),
    (["world", "new", "--kind", "swamp"], "hint: kinds: arena, doorway, maze, office, slalom\n"),
    (["world", "new", "--out", "a.txt"], "hint: --out FILE.toml\n"),
    (["world", "new", "--out", "missing/a.toml"], "no such file or directory\n"),
    (["world", "check", "."], "no world '.'"),
]


@pytest.mark.parametrize(("words", "said"), COMMANDS_THAT_FAIL)
def test_what_cannot_be_is_one_line_and_a_hint(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") <= 2


@pytest.mark.parametrize("words", [["world"], ["world", "list"]])
def test_the_worlds_that_ship_are_listed(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(known_worlds())


def test_the_list_comes_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["world", "list", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(known_worlds())


@pytest.mark.parametrize("name", known_worlds())
def test_a_world_is_drawn_in_the_terminal(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["world", "show", name]) == 0
    out = capsys.readouterr().out
    drawing, summary = out.splitlines()[:-1], out.splitlines()[-1]
    assert summary.startswith(f"{name}, ")
    assert "→" in out
    assert max(map(len, drawing)) <= 100
    assert sum(character in "▀▄█" for line in drawing for character in line) > 50


def test_a_drawing_in_the_terminal_says_which_way_is_up_and_how_large_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["world", "show", "corridor"]) == 0
    # 13 m on 80 characters: 0.1625 m each.
    assert capsys.readouterr().out.splitlines()[-2] == (
        "x → right, y ↑ up; a character is 0.16 m wide, 0.33 m high; start 0, 0, 0°"
    )


def test_a_world_is_drawn_into_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "office.svg"
    assert run(["world", "show", "office", "--out", str(path)]) == 0
    drawn = path.read_text(encoding="utf-8")
    assert drawn.startswith("<svg ")
    assert "1 that walks, 6 that can be pushed" in capsys.readouterr().out
    for words in ("<title>visitor</title>", "start, heading 0°", "x, m →  (heading 0°)", "y, m →  (heading 90°)",
                  ">2 m</text>"):  # fmt: skip
        assert words in drawn


@pytest.mark.parametrize("words", [["new", "--kind", "maze"], ["convert", "room"]], ids=["new", "convert"])
def test_a_world_file_that_was_changed_by_hand_is_overwritten_by_force_alone(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text("# an evening's work\n", encoding="utf-8")
    assert run(["world", *words, "--out", str(mine)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"p2os: {mine} is there already", "hint: another name, or --force to overwrite it",
    ]  # fmt: skip
    assert mine.read_text(encoding="utf-8") == "# an evening's work\n"
    assert run(["world", *words, "--out", str(mine), "--force"]) == 0
    assert load_world(str(mine))


def test_a_made_world_is_checked_and_converted_to_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["world", "new", "--kind", "maze", "--seed", "7", "--out", "mine.toml"]) == 0
    assert run(["world", "check", "mine.toml"]) == 0
    assert "mine.toml: maze, 9.4 x 9.4 m: " in capsys.readouterr().out
    assert run(["world", "convert", "mine.toml", "--out", "again.toml"]) == 0
    assert Path("again.toml").read_bytes() == Path("mine.toml").read_bytes()
    assert load_world("again.toml") == load_world("mine.toml")
    capsys.readouterr()
    assert run(["world", "new", "--kind", "maze", "--seed", "7"]) == 0
    assert capsys.readouterr().out == Path("mine.toml").read_text()


def test_a_broken_world_is_named_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.toml").write_text('name = "x"\nextent_m = [0, 0, 1, 1]\n\n[start]\nx_mm = 3\n')
    assert run(["world", "check", "bad.toml"]) == 2
    assert capsys.readouterr().err == "p2os: bad.toml:5: [start]: unknown key 'x_mm'\nhint: did you mean 'x_m'?\n"


def test_a_start_where_no_robot_can_stand_is_named_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    post = '[[cylinder]]\nname = "post"\nx_m = 1\ny_m = 0\nradius_m = 0.1\n'
    for x_m, said in ((1, "in world 'yard' is inside 'post'"), (4, "is not in world 'yard'")):
        Path("yard.toml").write_text(f'name = "yard"\nextent_m = [-3, -3, 3, 3]\n[start]\nx_m = {x_m}\n{post}')
        for words in (["world", "check", "yard.toml"], ["serve", "--world", "yard.toml", "--port", "tcp:127.0.0.1:0"]):
            assert run(words) == 2
            assert f"p2os: yard.toml:3: [start]: x {x_m}, y 0 {said}\n" in capsys.readouterr().err
