"""Declared state: what a snapshot holds, what restoring leaves in place, and that no part forgets an attribute."""

import ast
import ctypes
import importlib
import inspect
import pickle
import pkgutil
import random
from array import array
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbase.installation import GROUP
from simbase.state import PartState, Rows, Stateful, state_names
from simbase.user_classes import OF_USERS


def reloaded(data: bytes) -> Any:
    return pickle.loads(data)  # noqa: S301  # our own bytes


class Colour(Enum):
    RED = 1
    BLUE = 2


class Point(NamedTuple):
    x: int
    y: int


@dataclass
class Wheel:
    speed: int = 0
    marks: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Limits:
    top: int = 3


class Child(Stateful):
    STATE = ("count",)

    def __init__(self, count: int = 0) -> None:
        self.count = count
        self.listener = print


class Part(Stateful):
    STATE = ("number", "wheel", "limits", "queue", "table", "child", "children", "colour", "named", "levels", "memory",
             "source", "counts", "raw", "pairs", "words", "rows")  # fmt: skip
    DERIVED = ("twice",)

    def __init__(self) -> None:
        self.number: float | None = None
        self.wheel, self.limits = Wheel(), Limits()
        self.queue: deque[int] = deque([1], maxlen=4)
        self.table: dict[str, list[int]] = {"a": [1]}
        self.child = Child()
        self.children = {"left": Child(1), "right": Child(2)}
        self.colour, self.named = Colour.RED, Point(1, 2)
        self.levels = {1, 2}
        self.memory = (ctypes.c_uint8 * 4)(1, 2, 3, 4)
        self.source = random.Random(3)
        self.counts: Counter[str] = Counter(a=0, b=2)
        self.raw = bytearray(b"abc")
        self.pairs = (Child(5), None, Wheel(6))
        self.words = array("I", [1, 2])
        self.rows: tuple[tuple[int, ...], ...] = ((1, 2),)
        self.twice = 0
        self.settings = print

    def _restored(self) -> None:
        self.twice = 2 * int(self.number or 0)


def changed(part: Part) -> None:
    part.number = 7.5
    part.wheel.speed, part.wheel.marks[:] = 9, [1, 2]
    part.limits = Limits(4)
    part.queue.extend([5, 6])
    part.table["a"].append(2)
    part.table["b"] = []
    part.child.count, part.children["left"].count = 3, 4
    part.colour, part.named = Colour.BLUE, Point(3, 4)
    part.levels.add(3)
    part.memory[0] = 99
    part.source.random()
    part.counts["c"] += 1
    part.raw += b"d"
    part.words[1] = 7
    part.rows = ((3,), ())
    part.pairs[0].count, part.pairs[2].speed = 8, 9  # type: ignore[union-attr]


def test_what_was_changed_is_put_back_and_gives_the_same_snapshot() -> None:
    part = Part()
    before = part.snapshot()
    drawn = random.Random(3).random()
    changed(part)
    assert part.snapshot() != before
    part.restore(before)
    assert part.snapshot() == before
    assert (part.number, part.wheel, list(part.queue), part.queue.maxlen) == (None, Wheel(), [1], 4)
    assert (part.counts, type(part.counts), bytes(part.memory)) == (Counter(a=0, b=2), Counter, b"\x01\x02\x03\x04")
    assert (part.words, part.rows) == (array("I", [1, 2]), ((1, 2),))
    assert part.source.random() == drawn


def test_a_snapshot_goes_through_a_pickle_into_a_part_built_alike() -> None:
    part, other = Part(), Part()
    changed(part)
    other.restore(reloaded(pickle.dumps(part.snapshot())))
    assert other.snapshot() == part.snapshot()
    assert other.twice == 14


def test_whoever_refers_to_what_a_part_holds_sees_it_restored() -> None:
    part = Part()
    held = [part.wheel, part.wheel.marks, part.queue, part.table, part.child, part.children, part.children["left"],
            part.levels, part.memory, part.source, part.raw, part.words, part.pairs,
            part.pairs[0], part.pairs[2]]  # fmt: skip
    before = part.snapshot()
    changed(part)
    part.restore(before)
    now = [part.wheel, part.wheel.marks, part.queue, part.table, part.child, part.children, part.children["left"],
           part.levels, part.memory, part.source, part.raw, part.words, part.pairs,
            part.pairs[0], part.pairs[2]]  # fmt: skip
    assert all(one is other for one, other in zip(held, now, strict=True))


def test_a_snapshot_stays_as_it_is_however_often_it_is_restored() -> None:
    part = Part()
    changed(part)
    saved = part.snapshot()
    kept = pickle.dumps(saved)
    for _ in range(2):
        part.restore(saved)
        changed(part)
        part.table.clear()
        part.queue.clear()
    assert pickle.dumps(saved) == kept


def test_a_random_generator_that_is_not_there_yet_is_made_anew() -> None:
    saved = Holder({"noise": random.Random(3)}).snapshot()
    for other in (Holder({}), Holder({"noise": random.Random(4), "later": random.Random(5)})):
        other.restore(reloaded(pickle.dumps(saved)))
        assert [source.random() for source in other.held.values()] == [random.Random(3).random()]


def test_an_order_of_keys_that_has_changed_is_put_back() -> None:
    part = Part()
    part.table = {"a": [], "b": []}
    before = part.snapshot()
    part.table["a"] = part.table.pop("a")
    part.restore(before)
    assert list(part.table) == ["a", "b"]


class Holder(Stateful):
    STATE = ("held",)

    def __init__(self, held: object) -> None:
        self.held: Any = held


@pytest.mark.parametrize(
    ("built", "saved", "says"),
    [
        ([Child(), Child()], [Child()], "more parts"),
        ([Child()], [Child(), Child()], "no part"),
        ({"a": Child()}, {"b": Child()}, "no part"),
        ({"a": Child(), "b": Child()}, {"a": Child()}, "more parts"),
        (Child(), Wheel(), "not a snapshot of Child"),
        (None, Child(), "no part"),
    ],
)
def test_a_snapshot_of_other_parts_is_refused(built: object, saved: object, says: str) -> None:
    with pytest.raises(TypeError, match=says):
        Holder(built).restore(Holder(saved).snapshot())


@pytest.mark.parametrize("wrong", [None, {}, PartState(), PartState(number=1), 3])
def test_what_is_no_snapshot_is_refused(wrong: object) -> None:
    with pytest.raises(TypeError, match="not a snapshot of Part"):
        Part().restore(wrong)


@pytest.mark.parametrize("held", [print, object(), [lambda: None], {"a": open}, Wheel, iter([])])
def test_what_is_no_state_is_refused_by_the_name_of_its_attribute(held: object) -> None:
    with pytest.raises(TypeError, match="held holds"):
        Holder(held).snapshot()


class Twin:
    """A part whose state another language holds."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def snapshot(self) -> bytes:
        return self.data

    def restore(self, snapshot: bytes) -> None:
        self.data = snapshot


def test_whatever_saves_and_restores_itself_is_a_part() -> None:
    holder = Holder([Twin(b"a"), {"twin": Twin(b"b")}])
    saved, twins = holder.snapshot(), (holder.held[0], holder.held[1]["twin"])
    twins[0].data = twins[1].data = b"c"
    holder.restore(saved)
    assert (holder.held[0], holder.held[1]["twin"]) == twins
    assert [twin.data for twin in twins] == [b"a", b"b"]
    with pytest.raises(TypeError, match="more parts"):
        Holder([Twin(b""), Twin(b"")]).restore(Holder([Twin(b"")]).snapshot())


class Bulb(Stateful):
    STATE = ("colour", "limits", "is_on")
    DERIVED = ("shows",)

    def __init__(self) -> None:
        self.colour: object = Colour.RED
        self.limits: Limits | None = None
        self.is_on = False
        self.worked_out = 0
        self._restored()

    def _restored(self) -> None:
        self.shows = self.colour if self.is_on else None
        self.worked_out += 1


class Chain(Stateful):
    STATE = ("rows",)

    def __init__(self, bulbs: int) -> None:
        self.bulbs = [Bulb() for _ in range(bulbs)]
        self.rows = Rows(self.bulbs)


def test_rows_are_put_back_where_they_have_changed_and_that_is_worked_out_again() -> None:
    chain, twin = Chain(3), Chain(3)
    chain.bulbs[1].is_on, chain.bulbs[1].colour, chain.bulbs[2].limits = True, Colour.BLUE, Limits(4)
    bulbs, saved = list(twin.bulbs), reloaded(pickle.dumps(chain.snapshot()))
    twin.restore(saved)
    assert twin.snapshot() == saved == chain.snapshot()
    assert twin.bulbs == bulbs
    assert [bulb.shows for bulb in bulbs] == [None, Colour.BLUE, None]
    assert [bulb.worked_out for bulb in bulbs] == [1, 2, 2]


def test_rows_refuse_what_is_not_kept_as_it_is_and_the_rows_of_others() -> None:
    chain = Chain(2)
    for wrong in (Chain(3).snapshot(), PartState(rows=(("red",), ("red",))), PartState(rows=None)):
        with pytest.raises(TypeError, match="not a snapshot of these rows"):
            chain.restore(wrong)
    chain.bulbs[1].colour = [1]
    with pytest.raises(TypeError, match="a row holds list, which is not kept as it is"):
        chain.snapshot()


def test_a_dataclass_declares_its_fields_and_a_subclass_adds_to_its_base() -> None:
    @dataclass
    class Fields(Stateful):
        one: int = 1
        two: int = 2

    class More(Child):
        STATE = ("other", "count")

    assert state_names(Fields) == ("one", "two")
    assert state_names(More) == ("count", "other")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text() | st.binary() | st.sampled_from(Colour),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner) | st.lists(inner).map(tuple)
    | st.lists(inner).map(deque) | st.binary().map(bytearray) | st.sets(st.integers()),
)  # fmt: skip


@pytest.mark.slow
@given(VALUES, VALUES)
def test_any_value_is_restored_over_any_other(before: object, after: object) -> None:
    part = Holder(before)
    kept = pickle.dumps(before)
    saved = part.snapshot()
    part.held = after
    part.restore(saved)
    assert part.held == reloaded(kept)
    assert type(part.held) is type(reloaded(kept))
    assert part.snapshot() == saved


# No part forgets an attribute ------------------------------------------------------------

#: Of what is installed.
PACKAGES = [importlib.import_module(point.name) for point in entry_points(group=GROUP)]
#: Methods that change the container they are called on.
CHANGING = {"append", "appendleft", "extend", "clear", "pop", "popleft", "popitem", "add", "discard", "remove",
            "update", "insert", "setdefault", "sort", "reverse", "rotate"}  # fmt: skip
#: Where attributes may be set that are no state: what builds a part, and what works out the rest.
BUILDING = {"__init__", "__post_init__", "_restored", "__new__"}


def parts(base: type = Stateful) -> Iterator[type]:
    for part in base.__subclasses__():
        yield part
        yield from parts(part)


def own_attribute(node: ast.expr) -> str | None:
    """Return X of self.X, self.X[...] and self.X.y: what changes when it is assigned to."""
    while isinstance(node, ast.Subscript):
        node = node.value
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
        return node.attr
    return None


@cache
def classes(file: str) -> dict[str, ast.ClassDef]:
    """Return the classes of a source file by their qualified names; `inspect.getsource` parses it for each anew."""
    found = {}

    def look(tree: ast.AST, within: str) -> None:
        for node in ast.iter_child_nodes(tree):
            inside = within
            if isinstance(node, ast.ClassDef):
                found[f"{within}{node.name}"], inside = node, f"{within}{node.name}."
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                inside = f"{within}{node.name}.<locals>."
            look(node, inside)

    look(ast.parse(Path(file).read_text(encoding="utf-8")), "")
    return found


def changes(part: type) -> set[str]:
    """Return the attributes that a class changes after it was built."""
    tree = classes(inspect.getfile(part))[part.__qualname__]
    found: set[str | None] = set()
    for method in tree.body:
        if not isinstance(method, ast.FunctionDef) or method.name in BUILDING:
            continue
        is_setter = any(isinstance(item, ast.Attribute) and item.attr == "setter" for item in method.decorator_list)
        for node in ast.walk(method):
            if isinstance(node, ast.Attribute | ast.Subscript) and isinstance(node.ctx, ast.Store | ast.Del):
                found.add(own_attribute(node))
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGING:
                found.add(own_attribute(node.func.value))
        if is_setter:
            found.discard(method.name)
    return {name for name in found if name is not None and not isinstance(vars(part).get(name), property)}


def undeclared(part: type) -> set[str]:
    derived = {name for base in part.__mro__ for name in vars(base).get("DERIVED", ())}
    return changes(part) - set(state_names(part)) - derived


@pytest.mark.slow
def test_every_part_declares_what_it_changes() -> None:
    for package in PACKAGES:
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                try:
                    importlib.import_module(module.name)
                except ImportError:
                    continue
    forgotten = {f"{part.__module__}.{part.__qualname__}": names
                 for part in parts() if part.__module__.split(".")[0] != __name__.split(".")[0]
                 and not part.__module__.startswith(OF_USERS)
                 and (names := undeclared(part))}  # fmt: skip
    assert forgotten == {}


class Forgetful(Stateful):
    STATE: ClassVar = ("kept",)
    DERIVED: ClassVar = ("worked_out",)

    def __init__(self) -> None:
        self.kept = self.worked_out = self.lost = 0
        self.filled: list[int] = []
        self.table: dict[str, int] = {}

    def change(self) -> None:
        self.kept += 1
        self.worked_out = 2
        self.lost, _ = 3, 4
        self.filled.append(1)
        self.table["a"] = 1


def test_the_judge_sees_what_a_part_forgets() -> None:
    assert undeclared(Forgetful) == {"lost", "filled", "table"}
