"""Quantities as people type them, names and words in messages, first bytes and saved states, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import ctypes
import random
from array import array
from collections import Counter, OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from simbase import timing
from simbase.command_line.help_pages import first_sentence, folded
from simbase.errors import FileError, UsageError, nearest, one_line, shown, shown_name
from simbase.files import VersionedFormat, hint_of, reason_of, with_plain_ends
from simbase.listening import FirstBytes
from simbase.state import PartState, Rows, Stateful, state_names
from simbase.terminal import readable
from simbase.units import (
    ANGLE,
    BAUD,
    COUNT,
    FACTOR,
    LENGTH,
    PERCENT,
    PORT,
    SPEED,
    TIME,
    TURN_RATE,
    range_words,
    ranges_text,
)
from simbase.wire import are_fighting, level_of
from tests.tools.suite.approved import Trace, judge_of, refusal, said, tried
from tests.tools.suite.declared import declared_of

QUANTITIES = (LENGTH, ANGLE, SPEED, TURN_RATE, TIME, BAUD, FACTOR, PERCENT, COUNT, PORT)
NUMBERS = (
    "0",
    "-0",
    "1",
    "1.5",
    "-2",
    ".5",
    "1e3",
    "1e-3",
    "1e400",
    "0.1234567",
    "+3",
    "",
    "x",
    "1_0",
    "99999999999999999999",
)
ODD = (
    "",
    "a",
    "a\n  b",
    "\x1b[31m",
    "ä\u202e",
    "x" * 60,
    "x" * 61,
    "x" * 240,
    "x" * 241,
    "x" * 499,
    "x" * 500,
    "x" * 501,
    "a\tb",
)


def quantities(draw: random.Random) -> Iterator[str]:
    for one in QUANTITIES:
        for number in NUMBERS:
            units = [*one.units, "", "µs", "km"]
            yield "\n".join(tried(one.read, f"{number}{draw.choice(('', ' '))}{unit}") for unit in units)
        unit = next(iter(one.units))
        for least, most, above in (
            ("0", "", False),
            (f"1{unit}", f"2{unit}", False),
            ("", f"2{unit}", True),
            ("", "", True),
        ):
            parse = one.parser(UsageError, least=least, most=most, above_zero=above)
            yield "\n".join(tried(parse, f"{value}{unit}") for value in ("-1", "0", "0.5", "1", "1.5", "2", "3"))
            words = {"least": least, "most": most, "above_zero": above, "shown": draw.choice(("", "7"))}
            made = one.option(UsageError, purpose="what for", **words)  # type: ignore[arg-type]
            yield said(
                [made["help"], made["metavar"], made["show_default"], range_words(least, most, above_zero=above)]
            )
    yield said([ranges_text(draw.sample(range(12), count)) for count in range(9)])


def words(draw: random.Random) -> Iterator[str]:
    for text in ODD:
        yield said((one_line(text), shown(text), shown_name(text), readable(text), first_sentence(text)))
    yield said([shown(value) for value in (1, True, None, [1] * 40, 10**5000)])
    known = ("forward", "turn", "speed")
    yield said(
        [nearest(word, known, otherwise) for word in ("forwrd", "tun", "zzz", "") for otherwise in (None, "else")]
    )
    yield said([nearest("x", ()), with_plain_ends("a\r\nb\rc\n")])
    for number in (2, 13, 28, 30, 5, 9999):
        error = OSError(number, "Words Of It")
        yield said((reason_of(error), hint_of(error)))
    yield said((reason_of(OSError("Bare")), hint_of(OSError("Bare"))))
    for value in (None, 0, 1, 2, 3, True, "1", 1.0):
        yield tried(VersionedFormat("a thing", 2).version_of, value, draw.choice(("", "f.toml:1")), FileError)
    text = "p2os drive --forward 1m   Drive a metre\np2os x  y\n\nAnother paragraph. And more of it.\nand a line"
    yield "\n---\n".join(folded(text, width) for width in (20, 38, 39, 40, 80))
    yield said([first_sentence(each) for each in (None, text, "One. Two.", "One.", "One\ntwo. Three")])


def first_bytes(draw: random.Random) -> Iterator[str]:
    for opening in (
        b"GET / HTTP/1.1",
        b"POST /",
        b"\x16\x03\x01\x02",
        b"\xfa\xfb\x03\0\0\0",
        b"GE",
        b"G\xfa",
        b"",
        b"OPTIONS *",
        b"PRI * HTTP/2.0",
    ):
        for size in (1, 3, 99):
            first, seen = FirstBytes(), list[object]()
            try:
                for place in range(0, len(opening), size):
                    seen += [first.take(opening[place : place + size]), first.kept_bytes]
                seen.append(first.end())
            except ConnectionError as error:
                seen.append(refusal(error))
            yield said((seen, first.refused, first.kept_bytes))


class Inner(Stateful):
    """A part within a part."""

    STATE = ("numbers",)

    def __init__(self) -> None:
        self.numbers = [1, 2]


class Flat(Stateful):
    """A part of a row: plain values alone."""

    STATE = ("x", "name")

    def __init__(self, x: int) -> None:
        self.x, self.name = x, f"{x}"


class Outer(Stateful):
    """A part that keeps values of each sort."""

    STATE = ("value", "inner", "table", "row", "queue", "cells", "draws", "words", "inners")

    def __init__(self) -> None:
        self.value: object = 1
        self.inner, self.inners = Inner(), [Inner(), Inner()]
        self.table: dict[object, object] = {"a": [1], 2: (3, {4})}
        self.row, self.queue = (1, [2]), deque([1, 2], maxlen=3)
        self.cells, self.draws = array("q", [1, 2]), random.Random(3)
        self.words = OrderedDict(b=bytearray(b"x"), a={1, 2})


def states(draw: random.Random) -> Iterator[str]:
    part = Outer()
    saved = part.snapshot()
    before = part.draws.random()
    part.value, part.inner.numbers, part.table = None, [9], {"z": 1}
    part.inners[1].numbers.append(7)
    part.queue.append(5)
    part.cells.append(9)
    part.words["c"] = bytearray(b"y")
    changed = part.snapshot()
    part.restore(saved)
    yield said([part.value, part.inner.numbers, part.table, part.row, [*part.queue], part.queue.maxlen, [*part.cells]])
    yield said([[*map(str, part.words.items())], [each.numbers for each in part.inners], part.draws.random() == before])
    part.restore(changed)
    yield said([part.value, part.inner.numbers, part.table, [*part.queue], [each.numbers for each in part.inners]])
    short = PartState({key: saved[key] for key in [*saved][1:]})
    for broken in (PartState(), PartState({**saved, "more": 1}), short, PartState({**saved, "inners": []}), None):
        yield tried(part.restore, broken)
    flat = [Flat(1), Flat(2)]
    rows = Rows(flat)
    kept = rows.snapshot()
    flat[0].x, flat[1].name = 7, "z"
    yield said((kept, rows.snapshot(), tried(rows.restore, kept), [(each.x, each.name) for each in flat]))
    yield said((tried(rows.restore, kept[:1]), tried(rows.restore, ()), tried(Rows([Inner()]).snapshot)))


class Pair(NamedTuple):
    """A named tuple of state."""

    one: object
    other: object


@dataclass
class Record:
    """A dataclass that is filled anew."""

    number: int
    rows: list[int]


@dataclass(frozen=True)
class Fixed:
    """A dataclass that is kept as it is."""

    number: int


@dataclass
class Chosen(Stateful):
    """A dataclass that says which of its fields are state."""

    STATE = ("number",)

    number: int = 1
    other: int = 2


class Many(Stateful):
    """A part that holds one value, of whatever sort."""

    STATE = ("held", "more")

    def __init__(self, held: object) -> None:
        self.held, self.more, self.restored = held, 0, 0

    def _restored(self) -> None:
        self.restored += 1


class Derived(Many):
    """A part with state of its own beside that of its base."""

    STATE = ("less", "more")
    less = 7


def _words(count: int) -> object:
    return (ctypes.c_uint16 * 3)(count, count + 1, count + 2)


#: What a part may hold, made anew, and how it changes.
KINDS: tuple[tuple[Callable[[], Any], Callable[[Any], object]], ...] = (
    (lambda: Counter("aab"), lambda held: held.update("bc")), (lambda: defaultdict(list, a=[1]), lambda held: held["b"].append(2)),
    (lambda: Pair([1], 2), lambda held: held.one.append(3)), (lambda: Record(1, [2]), lambda held: held.rows.append(4)),
    (lambda: Fixed(3), id), (lambda: _words(1), lambda held: held.__setitem__(1, 9)), (lambda: random.Random(5), lambda held: held.random()),
    (lambda: deque([[1], [2]], maxlen=2), lambda held: held.append([3])), (lambda: {"a": Inner(), "b": Inner()}, lambda held: held.pop("a")),
    (lambda: {"a": Inner()}, lambda held: held.update(b=Inner())), (lambda: [Inner()], lambda held: held.append(Inner())),
    (lambda: (Inner(), [1]), lambda held: held[1].append(2)), (lambda: {1, 2}, lambda held: held.add(3)), (lambda: bytearray(b"ab"), lambda held: held.extend(b"c")),
    (lambda: array("H", [1, 2]), lambda held: held.append(3)), (lambda: {"a": {"b": [1]}}, lambda held: held["a"]["b"].append(2)),
    (lambda: [1, 2, 3], lambda held: held.clear()), (lambda: ([1], (2, [3])), lambda held: held[1][1].append(4)), (lambda: print, id), (lambda: [print], id),
    (lambda: {"a": 1, "b": 2}, lambda held: held.update(a=held.pop("a"))), (lambda: b"ab", id), (lambda: {"x": Record(1, [2])}, lambda held: held["x"].rows.clear()),
)  # fmt: skip


def kinds(draw: random.Random) -> Iterator[str]:
    """Save values of every kind, change them, restore them twice and elsewhere."""
    for make, change in KINDS:
        part, other = Many(make()), Many(None)
        try:
            saved = part.snapshot()
        except TypeError as error:
            yield refusal(error)
            continue
        yield said([[*saved], *map(_shown, saved.values())])
        before = part.held
        change(part.held)
        part.more = 1
        yield said([_shown(part.held), _shown(saved["held"])])
        for restored in (part, part, other):
            yield tried(
                lambda restored=restored, saved=saved: [
                    restored.restore(saved),
                    _shown(restored.held),
                    restored.more,
                    restored.restored,
                ]
            )
        yield tried(lambda change=change, part=part: change(part.held) and None)
        yield said([part.held is before, _shown(part.held), _shown(saved["held"])])
    yield said([state_names(each) for each in (Many, Derived, Record, Outer, Chosen)])
    yield tried(Derived(1).restore, Many(1).snapshot())
    yield said(
        [
            [level_of(hard, pulls) for pulls in ((), (True,), (False, True))]
            for hard in ((), (True,), (False,), (True, False))
        ]
    )
    yield said([are_fighting(hard) for hard in ((), (True,), (True, False), (None, True), (True, True))])
    yield said([timing.nanos(span) for span in (0.0, 1e-9, 1.5e-9, 2.5e-9, 1.0, -0.25)])
    yield said([timing.Reached(5), *timing.Reason])


def _shown(held: object) -> str:
    """Return what is held as text, whatever it is."""
    kind = type(held).__name__
    if isinstance(held, Inner | random.Random):
        return f"{kind} {said(held.numbers if isinstance(held, Inner) else held.getstate()[1][-1])}"
    if isinstance(held, ctypes.Array):
        return f"words {said([*held])}"
    if isinstance(held, dict):
        return f"{kind}{said({key: _shown(each) for key, each in held.items()})}"
    if isinstance(held, list | tuple | deque):  # the longest is a generator's state
        return f"{kind}{said([*map(_shown, held)][:9])}"
    return said(sorted(held)) if isinstance(held, set) else said(held)


TRACES: dict[str, Trace] = {each.__name__: each for each in (quantities, words, first_bytes, states, kinds)}
TRACES["declared"] = declared_of("simbase", "simbase.command_line", "simbase.trust")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
