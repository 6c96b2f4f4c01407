"""Robot files and tables of a user's files, sound and spoilt, and pads that report anything, as approved."""

import random
import re
import tempfile
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from p2os.gamepad import Gamepad, PadReport
from p2os.robots import model
from p2os.robots.aria_file import counts_per_turn
from p2os.robots.parameters import known_robots, load_parameters, nearest_model
from p2os.toml_file import TomlSource, find_places, line_of_error, read_toml, toml_text
from p2os.toml_schema import Key, Kind, TablePlace, filled, within
from simbase.errors import FileError
from simbase.timing import NS_PER_MS
from tests.p2os.robots.test_robot_files import MINE
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

P2DX = files("p2os.robots").joinpath("p2dx.toml").read_text(encoding="utf-8")
PROPERTIES = [name for name, value in vars(model.RobotParameters).items() if isinstance(value, property)]
_VALUE = re.compile(r"-?\d+(?:\.\d+)?|true|false|\"[^\"\n]*\"")
VALUES = ("0", "-1", "1", "0.5", "true", '"x"', "99999999", "[1, 2]", "nan")
SOURCE = "a = 1\n[part]\nb = 2\n[[row]]\nlength_m = 3\n[[row]]\nc = [1,\n 2]\n"
KINDS: tuple[Kind, ...] = (
    "any", "text", "texts", "line", "ascii", "number", "numbers", "points", "whole", "flag", "table", "tables", "list",
)  # fmt: skip


def robots(draw: random.Random) -> Iterator[str]:
    for name in known_robots():
        robot = load_parameters(name)
        yield said((robot, [getattr(robot, each) for each in PROPERTIES], robot.with_every_sonar().sonar_fitted))
    yield said([nearest_model(name) for name in ("p3dx-sh-x", "p2d", "", "amigo2", "zzz")])
    yield said([counts_per_turn(radians) for radians in (0.00153, 0.001534, 6.28 / 4096, 0.01)])


def robot_files(draw: random.Random) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as made:
        for name, text in (("my.toml", P2DX), ("my.p", MINE)):
            places = [*(_VALUE if name == "my.toml" else re.compile(r"(?<= )-?\d+(?:\.\d+)?")).finditer(text)]
            for one in places if name == "my.p" else draw.sample(places, 25):
                path = Path(made) / name
                path.write_text(text[: one.start()] + draw.choice(VALUES) + text[one.end() :], encoding="utf-8")
                yield tried(load_parameters, path).replace(made, "…")


def values(draw: random.Random) -> Iterator[str]:
    """Ask each kind of key about each kind of value."""
    where = TablePlace(TomlSource("w.toml", find_places(SOURCE)), error=FileError)
    several = (
        0,
        1,
        3,
        3.5,
        -1,
        True,
        "x",
        "äö",
        "a\n",
        "abcdef",
        [],
        [1, 2],
        [1, "x"],
        [[0, 1], [2, 3]],
        {},
        [{}],
        ["x"],
        None,
    )
    for kind in KINDS:
        for bounds in ({}, {"least": 0, "most": 3}, {"above": 0}, {"count": 2, "most": 2}, {"choices": ("x", "y")}):
            key = Key(name=draw.choice(("a", "b_m", "c_deg_s", "d_s")), kind=kind, **bounds)  # type: ignore[arg-type]
            at = draw.choice((where, within(where, "part"), within(where, "row", 1), "here"))
            yield "\n".join(tried(filled, {key.name: value}, [key], at) for value in several)
            yield tried(filled, {draw.choice(("aa", "b_mm", "c")): 1}, [key], at)
            yield tried(filled, {}, [key, Key(name="e", required=True, kind=kind)], at)


def texts(draw: random.Random) -> Iterator[str]:
    for _ in range(60):
        lines = [line for line in SOURCE.splitlines() if draw.random() < 0.9]
        text = "\n".join(
            draw.choice((lines, [*lines, draw.choice(("b = ", "[x", "a = 1", 'c = """', "= 3", "[[row]]"))]))
        )
        yield tried(lambda text=text: read_toml(text, "w.toml", "a file", FileError)[0])
        places = find_places(text)
        yield said(
            [
                places.line(table, number, key)
                for table in ("", "part", "row")
                for number in (0, 1, 2)
                for key in ("", "b", "c")
            ]
        )
        yield said(line_of_error(f"bad (at line {draw.randint(1, 9)}, column 3)", text))
    yield toml_text(
        {"a": 1, "t": 'x\n"y" ä', "b": [1.5, True, "z"], "c d": {"e": {"f": []}, "g": [{"h": 1}, {}]}, "n": -0.0}
    )


def pads(draw: random.Random) -> Iterator[str]:
    for dead in (0, 40, 300):
        pad, now = Gamepad(trigger_dead=dead, stick_dead=dead, loss_ns=70 * NS_PER_MS), 0
        for number in range(60):
            now += draw.randrange(90) * NS_PER_MS
            levels = (0, dead, dead + 1, dead + 2, 512, 1022, 1023, 2000)
            report = PadReport(
                up=draw.random() < 0.4, down=draw.random() < 0.2, forward=draw.choice(levels),
                backward=draw.choice((0, 0, *levels)), turn=draw.choice((-512, -511, -dead - 1, -dead, *levels)),
            )  # fmt: skip
            if number % 20:
                pad.take(report, now)
            else:
                pad.lose()
            if number % 13 == 0:
                pad.forget_request()
            yield said((pad.forward, pad.turn, pad.wants_robot, pad.lost_at))
    yield said(Gamepad().snapshot())


TRACES: dict[str, Trace] = {each.__name__: each for each in (robots, robot_files, values, texts, pads)}
TRACES["declared"] = declared_of("p2os", "p2os.robots")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
