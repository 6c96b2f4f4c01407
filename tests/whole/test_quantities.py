"""Numbers with units on every command line, and the pages of help that show them."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from p2os.cli.groups import GroupedVerbs
from p2os.cli.main import completed_words, make_app, run
from simbase.command_line.help_pages import OTHERS, VerbList, first_sentence
from simbase.errors import UsageError
from simbase.units import ANGLE, BAUD, COUNT, FACTOR, LENGTH, SPEED, TIME, TURN_RATE, Quantity

#: One style: what is typed as it is in small letters, what stands for something in capitals.
METAVAR = re.compile(r"[A-Za-z0-9_|,=@:.\[\]% -]+")

#: Those of the toolkit, then the emulator's.
GROUPS = (*GroupedVerbs.groups, "BluePill")


def commands(command: Any = None, path: str = "p2os") -> Iterator[tuple[str, Any]]:
    """Every command, with the words that call it."""
    found = command or typer.main.get_command(make_app())
    yield path, found
    for name, below in getattr(found, "commands", {}).items():
        yield from commands(below, f"{path} {name}")


@pytest.mark.parametrize(
    ("quantity", "text", "value"),
    [(LENGTH, "0.5m", 0.5), (LENGTH, "-20 cm", -0.2), (LENGTH, "0", 0.0), (ANGLE, "180deg", 3.141592653589793),
     (SPEED, ".2m/s", 0.2), (SPEED, "1e2mm/s", 0.1), (TURN_RATE, "1rad/s", 1.0), (TIME, "+2min", 120_000_000_000),
     (TIME, "1.5s", 1_500_000_000),
     (TIME, "250µs", 250_000), (TIME, "0.1ms", 100_000),
     (TIME, "1h", 3_600_000_000_000), (BAUD, "9600", 9600), (BAUD, "38.4kbaud", 38400),
     (FACTOR, "2x", 2.0), (FACTOR, "0.5", 0.5), (COUNT, "3", 3)],
)  # fmt: skip
def test_quantities_have_units(quantity: Quantity, text: str, value: float) -> None:
    assert quantity.read(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["", "m", "5", "5km", "five m", "nan m", "1e999m", "5 5m"])
def test_what_is_no_length_is_refused_with_units_and_an_example(text: str) -> None:
    with pytest.raises(UsageError, match=r"in m, cm or mm, such as 0[.]5m"):
        LENGTH.read(text)


@pytest.mark.parametrize("text", ["1.5", "x", "1s"])
def test_what_is_no_count_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="such as 3"):
        COUNT.read(text)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("run dodge --duration 5", "--duration '5' has no unit: more than 0, in ns, us, ms, s, min or h, such as 2s"),
        ("run dodge --max-speed 300", "--max-speed '300' has no unit: 1mm/s or more, in m/s, cm/s or mm/s"),
        ("run dodge --seed -1", "--seed '-1' is out of range: 0 or more, such as 7"),
        ("demo --duration 0s", "--duration '0s' is out of range: more than 0"),
        ("drive tcp:x:1 --forward 1000.1m", "--forward '1000.1m' is out of range: -1000m to 1000m, in"),
        ("drive tcp:x:1 --forward -1000.1m", "--forward '-1000.1m' is out of range: -1000m to 1000m, in"),
        ("drive tcp:x:1 --turn 36001deg", "--turn '36001deg' is out of range: -36000deg to 36000deg, in"),
        ("drive tcp:x:1 --vel 1m/s --for 0s", "--for '0s' is out of range: more than 0"),
        ("drive tcp:x:1 --turn -36001deg", "--turn '-36001deg' is out of range: -36000deg to 36000deg, in"),
        ("serve --status 5", "--status '5' has no unit: 100ms or more"),
        ("serve --speed 1000", "--speed '1000' is out of range: 0.01 to 100"),
        ("serve --robots 0", "--robots '0' is out of range: 1 to 256"),
        ("serve --body kinematic --at 1,2", "--at '1,2' is no place: '1' has no unit"),
        ("serve --firmware X", "--firmware 'X' is not one of"),
        ("mcu run x.elf --budget 60", "--budget '60' has no unit: 0s to 8784h, in ns, us, ms, s, min or h, such as 2s"),
        (
            "mcu run x.elf --usart-baud fast",
            "--usart-baud 'fast' is no speed of a line: more than 0, in baud or kbaud, such as 9600",
        ),
        ("mcu debug x.elf --port 70000", "--port '70000' is out of range: 0 to 65535"),
        ("mcu coverage x.elf --fail-under 101%", "--fail-under '101%' is out of range: 0% to 100%"),
    ],
)
def test_a_value_that_cannot_be_is_one_line_with_range_and_units(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words.split()) == 2
    reported = capsys.readouterr().err.splitlines()
    assert reported[0].startswith(f"p2os: {said}")
    assert len(reported) == 2


@pytest.mark.parametrize(
    "words", ["--forward 1000m", "--forward -1000m", "--turn 36000deg", "--turn -36000deg", "--vel 1m/s --for 1ns"]
)
def test_a_value_at_its_bound_is_taken(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["drive", "loop:nobody", *words.split()]) == 1
    assert "exists only inside one program" in capsys.readouterr().err


def test_every_option_and_argument_shows_its_value_in_one_style() -> None:
    for path, command in commands():
        for parameter in command.params:
            shown = parameter.metavar
            if parameter.param_type_name == "option" and parameter.is_flag:
                continue
            if any("completion" in option for option in parameter.opts):  # typer's own two
                continue
            assert shown is not None, (path, parameter.opts)
            assert METAVAR.fullmatch(shown), (path, parameter.opts, shown)


def test_the_usage_of_every_verb_puts_what_may_be_left_out_in_brackets(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    seen = 0
    for path, command in commands():
        arguments = [one for one in command.params if one.param_type_name == "argument" and " " not in one.metavar]
        if not arguments:
            continue
        assert run([*path.split()[1:], "--help"]) == 0
        usage = capsys.readouterr().out.splitlines()[0]
        for one in arguments:
            words = one.metavar if one.required else f"[{one.metavar}]"
            dots = "" if one.nargs == 1 else "..."
            assert f" {words}{dots} " in usage, (path, usage)
            assert not set("[].") & set(one.metavar), "brackets and dots follow from the argument"
            seen += 1
    assert seen > 30


def test_the_number_of_runs_at_a_time_is_one_option_of_all_verbs() -> None:
    found = {path: one for path, command in commands() for one in command.params if "--jobs" in one.opts}
    assert {"p2os run", "p2os campaign", "p2os validate"} <= set(found)
    assert len({(one.help, one.metavar, *one.opts) for one in found.values()}) == 1, found


def test_every_verb_is_in_a_group_and_told_in_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["--help"]) == 0
    out = capsys.readouterr().out
    assert out.index("A test bench") < out.index("Options:") < out.index("Bench:") < out.index("demo ")
    assert [line for line in out.splitlines() if line.removesuffix(":") in {*GROUPS, OTHERS}] == [
        f"{g}:" for g in GROUPS
    ]
    for path, command in commands():
        if path == "p2os" or isinstance(command, VerbList):
            continue
        assert len(first_sentence(command.help)) <= 66, path


def test_no_page_of_help_is_wider_than_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    too_wide = []
    for path, _ in commands():
        assert run([*path.split()[1:], "--help"]) == 0
        too_wide += [line for line in capsys.readouterr().out.splitlines() if len(line) > 80]
    assert too_wide == []


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("p2os dri", ["drive"]),
        ("p2os drive --forw", ["--forward"]),
        ("p2os run do", ["dodge", "dodge-duty"]),
        ("p2os run dodge --world maz", ["maze"]),
        ("p2os run dodge --body kin", ["kinematic"]),
        ("p2os serve --robot p3dx-", ["p3dx-sh"]),
        ("p2os world sh", ["show"]),
        ("p2os mcu cov", ["coverage"]),
        ("p2os info tcp:1", ["tcp:127.0.0.1:8101"]),
        ("p2os run mot", ["motors"]),
        ("p2os mutate a.elf mot", ["motors"]),
        ("p2os mutate a.elf motors --body kin", ["kinematic"]),
        ("p2os sensitivity mot", ["motors"]),
        ("p2os shrink mot", ["motors"]),
        ("p2os run dodge --set mo", ["mode=direct", "mode=adapter"]),
        ("p2os run dodge --seed 1 --set start.h", ["start.heading_deg="]),
        ("p2os run dodge --set goal.2.dis", ["goal.2.distance_m=", "goal.2.distance_m_a_minute="]),
        ("p2os run two-dodge --set robot.2.na", ["robot.2.name="]),
        ("p2os run nowhere.toml --set goal.", []),
    ],
)
def test_a_shell_is_offered_verbs_options_and_names(
    line: str, offered: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - 1))
    monkeypatch.setenv("_P2OS_COMPLETE", "complete_bash")
    with pytest.raises(SystemExit) as end:
        run([])
    assert end.value.code == 0
    assert capsys.readouterr().out.split() == offered


@pytest.mark.parametrize(
    ("environment", "words"),
    [
        ({}, None),
        ({"_P2OS_COMPLETE": "complete_bash", "COMP_WORDS": "p2os run do", "COMP_CWORD": "2"}, ["run"]),
        ({"_P2OS_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "p2os run do"}, ["run"]),
        ({"_P2OS_COMPLETE": "complete_fish", "_TYPER_COMPLETE_ARGS": "p2os run "}, ["run"]),
        ({"_P2OS_COMPLETE": "source_bash"}, None),
    ],
)
def test_the_verb_that_is_typed_is_found_in_what_each_shell_tells(
    environment: dict[str, str], words: list[str] | None
) -> None:
    assert completed_words(environment) == words
