"""Robot files at the bounds of each of their keys, ARIA's files, records of tables, and places in texts, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import math
import random
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from p2os.gamepad import PadReport
from p2os.json_record import of_json
from p2os.robots.aria_file import KEYS, aria_table, counts_per_turn
from p2os.robots.model_file import RANGES, Table, build_parameters, known_robots, merged, shipped_table, table_of
from p2os.robots.parameters import load_parameters
from p2os.toml_file import TomlSource, find_places, read_toml
from p2os.toml_record import given, keys_of, number_of, read, read_part, sections, tables_of
from p2os.toml_record import table_of as table_of_key
from p2os.toml_schema import TablePlace
from simbase.errors import FileError
from simbase.files import VersionedFormat
from tests.p2os.test_toml_record import Outer
from tests.tools.suite.approved import Trace, judge_of, said, tried


def bounds(draw: random.Random) -> Iterator[str]:
    """Give each key of a robot file its least and its most, what is next to them, and nothing."""
    whole = shipped_table("p3at-sh")
    for section, ranges in RANGES.items():
        step = 0.0001 if section in {"sonar", "body"} else 1
        for key, (least, most) in ranges.items():
            for value in (least, least - step, most, most + step):
                yield _built(whole, section, **{key: value})
            yield _built(whole, section, leave=key)
    poses = whole["sonar"]["poses"]
    for x, y, turn in ((-20_000, 20_000, 360), (-20_001, 0, 0), (20_001, 0, 0), (0, -20_001, 0), (0, 20_001, 0), (0, 0, -361),
                       (0, 0, 361), (20_000, -20_000, -360)):  # fmt: skip
        yield _built(whole, "sonar", poses=[*poses[1:], [x, y, turn]])
        yield _built(whole, "infrared", points=[[x, y]])
    for count in (0, 8, 9):
        yield _built(whole, "sonar", fitted=len(poses) + count - 8)
        yield _built(whole, "infrared", points=[[100, 5]] * count)
    for wheels, wheel_kg, robot_kg in (
        (1, 1.0, 2.2),
        (2, 1.0, 2.2),
        (2, 1.0, 2.21),
        (4, 1.0, 4.2),
        (4, 1.0, 4.3),
        (5, 1.0, 5.3),
    ):
        table = {**whole, "equipment": {**whole["equipment"], "wheels": wheels}}
        yield _built(table, "body", wheel_mass_kg=wheel_kg, mass_kg=robot_kg)
    for hull_m, ground_m in ((0.1, 0.1), (0.1, 0.0999), (0.1, 0.2)):
        yield _built(whole, "body", hull_height_m=hull_m, ground_clearance_m=ground_m)
    for firmware in ("P2OS", ["ARCOS", "AROS", "ARCOS"], [], "AROZ", ["P2OS", "x"], 5):
        yield tried(lambda firmware=firmware: build_parameters("r.toml", {**whole, "firmware": firmware}).firmware)
    for title in ("a" * 100, "a" * 101, "ä", "", 5):
        yield tried(lambda title=title: build_parameters("r.toml", {**whole, "title": title}).title)


def bases(draw: random.Random) -> Iterator[str]:
    """Take other models' numbers, and place the wheels of robots with any number of them."""
    for base in ("p2dx", "nothing", "p2de"):
        yield tried(table_of, "mine.toml", f'based_on = "{base}"\ntitle = "t"\n[sonar]\nfitted = 0\n')
    yield tried(table_of, "p2dx.toml", 'title = "t"\nbased_on = "p2dx"\n')
    yield tried(table_of, "mine.toml", 'title = "t"\n\nbased_on = 5\n')
    yield said([merged({"a": {"b": 1, "c": 2}, "d": 1}, {"a": {"b": 3}, "d": {"e": 1}}), known_robots()])
    for wheels in (1, 2, 3, 4, 6, 8, 9):
        for axle_m, wide_m in ((0.0, 0.0), (0.5, 0.7)):
            robot = load_parameters("p3at-sh")
            body = replace(robot.body, axle_distance_m=axle_m, wheel_distance_m=wide_m)
            one = replace(robot, equipment=replace(robot.equipment, wheels=wheels), body=body)
            yield said((wheels, one.has_caster, one.wheel_places))


def _built(whole: Table, section: str, leave: str = "", **values: object) -> str:
    """Return what a robot's table comes to, shortly."""
    part = {**whole.get(section, {}), **values}
    part.pop(leave, None)
    text = tried(build_parameters, "r.toml", {**whole, section: part})
    return text if text.startswith("ParametersError") else f"{zlib.crc32(text.encode()):08x} {text[:60]}"


def _turned(key: str, value: str) -> object:
    section, name, _ = KEYS[key]
    return aria_table("r.p", f"Subclass p3dx-sh\n{key} {value}\n", str)[section][name]


def aria_files(draw: random.Random) -> Iterator[str]:
    """Give each key of ARIA's file 0, less, the ends of what a measure may be, and no number."""
    for key in KEYS:
        for value in ("0", "-1", "1", "7.3", "1e-6", "9e-7", "1e6", "1.1e6", "x"):
            yield tried(_turned, key, value)
    for more in (
        "SonarNum 3\nSonarUnit 1 5 6 7\nSonarUnit 0 1 2 3", "SonarNum 1\nSonarUnit 1 5 6 7\nSonarUnit 0 1 2 3", "SonarUnit 1 5 6", "SonarNum 0",
        "SonarUnit 1 5 6 x", "IRNum 2\nIRUnit 1 2 3 400 50\nIRUnit 0 1 2 300 40", "IRUnit 1 2 3 4", "IRUnit 1 2 3 x 5", "IRUnit 1 2 3 4 5",
        "RobotLength 501\nRobotLengthFront 0", "RobotLength 501\nRobotLengthFront 0\nRobotLengthRear 7", "RobotLength 501", "RobotLengthFront 9",
        "RobotLengthFront 0", "FrontBumpers true", "FrontBumpers TRUE\nNumFrontBumpers 3", "FrontBumpers no\nNumFrontBumpers 3",
        "RearBumpers true\nNumRearBumpers x", "HasMoveCommand True\nRequestIOPackets 0", "MaxVelocity 1 ; MaxVelocity 2\nMaxVelocity 3", ";MaxVelocity 9",
        "MaxVelocity", "Section MaxVelocity 9", "Class Mine",
    ):  # fmt: skip
        yield tried(aria_table, "r.p", f"Subclass p3dx-sh\n{more}\n", str)
    yield tried(aria_table, "r.p", "Class Pioneer\n", str)
    yield tried(aria_table, "r.p", "Subclass P2DX\n", str)
    yield tried(aria_table, "r.p", "Subclass mine\n", lambda _: "p2dx")
    for counts in (1, 2, 1024, 4075, 4076, 4096, 4116, 4117, 3000, 0.4):
        yield said((counts, counts_per_turn(2 * math.pi / counts)))


ROWS = (
    "from = 0", "from = 9", "from = 10", "from = -1", "from = 7", "", "from = 1\nshare = 0", "from = 1\nshare = 1", "from = 1\nshare = 1.1",
    'from = 1\ncolour = "red"\nside = "right"', 'from = 1\ncolour = "x"', 'from = 1\nnames = "a"', 'from = 1\nnames = ["a", "b"]', "from = 1\nnames = [1]",
    "from = 1\npath_m = [[0, 5]]", "from = 1\npath_m = [[0, 6]]", "from = 1\npath_m = [[0]]", "from = 1\nvolts = 25", "from = 1\nvolts = 26",
    "from = 1\nvolts = 1.5", "from = 1\n[inner]\nx_m = 1", "from = 1\n[inner]\nx_m = 2", 'from = 1\n[inner]\nx_m = 0\nnote = "n"',
    "from = 1\n[deep.inner]\nx_m = 0.5", "from = 1\n[deep.inner]\nx_m = 5", "from = 1\n[by_name.a]\nx_m = 0\n[by_name.b]\nx_m = 1",
    "from = 1\n[by_name.a]\nx_m = 9", "from = 1\nby_name = 1", "from = 1\n[by_name]\na = 1", "from = 1\n[[rows]]\nx_m = 0", "from = 1\nrows = 1",
    "from = 1\nother = 2", "from = true", "from = 1.5", "from = 1\n[inner]",
)  # fmt: skip


def records(draw: random.Random) -> Iterator[str]:
    """Read records of tables that have all, little, too much and the wrong."""
    yield said([*sections(Outer)])
    for key in keys_of(Outer):
        yield said(key)
    for text in ROWS:
        table, places = read_toml(text, "w.toml", "a file", FileError)
        where = TablePlace(TomlSource("w.toml", places), error=FileError)
        yield tried(lambda table=table, where=where: (read(Outer, table, where), [*given(read(Outer, table, where))]))
        yield tried(read_part, Outer, {**table, "more": 1}, where)
        yield said(
            [
                tables_of(table, "rows"),
                table_of_key(table, "inner"),
                number_of(table, "from", 3.0),
                number_of(table, "none", 3.0),
            ]
        )


@dataclass(frozen=True)
class One:
    """A record of one kind."""

    a: int
    kind: str = "one"


@dataclass(frozen=True)
class Two:
    """A record of another."""

    b: float
    kind: str = "two"


def of_text(draw: random.Random) -> Iterator[str]:
    """Read values of each type back out of JSON."""
    for hint, value in (
        (int, 1), (int, "1"), (float, 1), (float, 1.5), (float, "x"), (str, 1), (Literal["a", "b"], "a"), (Literal["a", "b"], "c"), (int | None, None),
        (int | None, 3), (int | None, "x"), (tuple[int, str], [1, "a"]), (tuple[int, str], [1]), (tuple[int, ...], [1, 2]), (tuple[int, ...], ["x"]),
        (PadReport, {"up": True, "turn": 5}), (PadReport, {"other": 1}), (One | Two, {"kind": "two", "b": 1}), (One | Two, {"kind": "one", "a": 1}),
        (One | Two, {"kind": "one"}), (One | Two | None, None), (One | Two, {}), (bool, 1), (int, True), (tuple[One, ...], [{"a": 2}]),
    ):  # fmt: skip
        yield tried(of_json, hint, value)


TEXTS = (
    'a.b = 1\n"c d" = 2\n[x."y z"]\nk = 3\n[x]\nt = """\nk = 4\n"""\nl = [ # [\n 1, "]",\n]\nm = {n = 1}\nlast = 5\n', "\ufeffa = 1", "a = 1\r\nb = 2\r\n",
    "a = '''\n[b]\n'''\nc = 1", "a = '''x''' # '''\nb = 1", 'a = """x\\"""" # c\nb = 1', "[[r]]\na = 1\n[[r]]\n[r.s]\nb = 1\n[[r]]\na = 2",
    "a = 'x # y'\nb = \"\\\"[\" # c\nd = 1", "[t] # c\na = [[1, 2], # d\n[3]]\nb = 1", "'a' = {b = [1]}\n[ c ]\nd = 1", "a = [\n{b = 1},\n'''\n]\n''']\nc = 2",
)  # fmt: skip


def places(draw: random.Random) -> Iterator[str]:
    """Find the lines of keys in texts with brackets, quotes and comments anywhere, and read them."""
    for text in TEXTS:
        found = find_places(text)
        yield said(found.lines)
        yield said(
            [
                found.line(table, number, key)
                for table in ("", "x", "x.y z", "r", "r.s", "none.q")
                for number in (0, 1)
                for key in ("", "a", "k", "s", "c d")
            ]
        )
        yield tried(lambda text=text: read_toml(text, "w.toml", VersionedFormat("a world", 2), FileError)[0])
    for version in ("1", "2", "3", "0", '"1"', "true"):
        yield tried(
            lambda version=version: read_toml(
                f"version = {version}", "w.toml", VersionedFormat("a world", 2), FileError
            )[0]
        )
    for text in (
        "a = ",
        "a = 1\nb = [",
        "a = 1\na = 2",
        "\x00",
        "a = 1979-05-27",
        "= 1",
        "[a]\n[a]",
        "a = nan",
        "a = " + "[" * 2000,
    ):
        yield tried(lambda text=text: read_toml(text, "w.toml", "a file", FileError)[0])


TRACES: dict[str, Trace] = {each.__name__: each for each in (bounds, bases, aria_files, records, of_text, places)}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
