"""KiCad's file syntax: S-expressions, a writer and a reader, and identifiers that never change from build to build.

KiCad names every object by a UUID. Ours are UUIDs of version 5 over a readable path
(`rev-b/U5/pad 3`), so that two builds write the same bytes.

Not here: what any list means. Invariant: `parse(render(tree)) == tree` for trees
of lists, bare words (`str`) and quoted strings (`QuotedText`).
"""

import re
import uuid
from typing import TypeAlias

from simbase.errors import P2osError

#: A list whose first element names it; elements are words, texts or lists.
Node: TypeAlias = "list[str | Node]"
#: Longest list that stays on one line. chosen: a stroke, a track or a pad's properties fit, so that a change of one
#: of them is a change of one line.
_LINE_LENGTH = 200
#: chosen: any fixed UUID; another one would rename every object.
_SPACE = uuid.UUID("6f2d6a53-77d5-5f0b-9a3c-0b5a5d1c9e11")


#: A bracket, a word, or the inside of a text: a text that does not end goes to the end.
_TOKEN = re.compile(r"""([()])|([^()"\s]+)|"((?:[^"\\]|\\.)*)"?""", re.DOTALL)
_ESCAPED = re.compile(r"\\(.)", re.DOTALL)


class QuotedText(str):
    """A string that is written in quotes."""

    __slots__ = ()


class SexpError(P2osError):
    """A text is no S-expression."""


def number(value: float) -> str:
    """Return a coordinate in millimetres as KiCad prints it: at most 6 decimals, no trailing zeros."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in {"-0", ""} else text


def node(name: str, *items: "str | float | Node") -> Node:
    """Build a list; numbers become words, strings stay as they are (`QuotedText` is quoted)."""
    return [name, *(number(item) if isinstance(item, (int, float)) else item for item in items)]


def render(tree: Node, depth: int = 0) -> str:
    """Return the text of a list, one nested list a line where it is long."""
    parts = [_word(item) if isinstance(item, str) else render(item, depth + 1) for item in tree]
    is_nested = any(not isinstance(item, str) for item in tree)
    if not is_nested or (sum(map(len, parts)) + len(parts) + 1 <= _LINE_LENGTH and not any("\n" in p for p in parts)):
        return "(" + " ".join(parts) + ")"
    indent = "\n" + "\t" * (depth + 1)
    out = [parts[0]]
    for item, part in zip(tree[1:], parts[1:], strict=True):
        out += [" " if isinstance(item, str) else indent, part]
    return "(" + "".join(out) + "\n" + "\t" * depth + ")"


def parse(text: str) -> Node:
    """Read one list.

    Raises:
        SexpError: The text does not begin with a list, or ends inside one.
    """
    if not text.lstrip().startswith("("):
        raise SexpError("expected an opening bracket")
    stack: list[Node] = []
    items: Node = []
    for bracket, bare, quoted in _TOKEN.findall(text):
        if bare:
            items.append(bare)
        elif bracket == "(":
            stack.append(items)
            items = []
        elif bracket:
            done, items = items, stack.pop()
            if not stack:
                return done
            items.append(done)
        else:
            items.append(QuotedText(_ESCAPED.sub(_unescaped, quoted) if "\\" in quoted else quoted))
    raise SexpError("the text ends inside a list")


def children(tree: Node, name: str) -> list[Node]:
    """Return the nested lists of that name, in order."""
    return [item for item in tree if isinstance(item, list) and item and item[0] == name]


def child(tree: Node, name: str) -> Node:
    """Return the first nested list of that name.

    Raises:
        SexpError: There is none.
    """
    found = children(tree, name)
    if not found:
        raise SexpError(f"no ({name} ...) in ({tree[0]} ...)")
    return found[0]


def word(tree: Node, index: int = 1) -> str:
    """Return an element that is no list.

    Raises:
        SexpError: It is a list, or missing.
    """
    item = tree[index] if index < len(tree) else None
    if not isinstance(item, str):
        raise SexpError(f"({tree[0]} ...) has no word at {index}")
    return item


def uid(*path: object) -> str:
    """Return the identifier of a path."""
    return str(uuid.uuid5(_SPACE, "/".join(str(part) for part in path)))


def uuid_node(*path: object) -> Node:
    """Return `(uuid "...")` of a path."""
    return node("uuid", QuotedText(uid(*path)))


def sheet_path(variant: str, page: str) -> str:
    """Return the path of a page below the root sheet, as symbols' instances name it."""
    return f"/{uid(variant, 'root')}/{uid(variant, 'sheet', page)}"


def _word(item: str) -> str:
    if isinstance(item, QuotedText):
        return '"' + item.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
    return item


def _unescaped(escaped: re.Match[str]) -> str:
    return "\n" if escaped[1] == "n" else escaped[1]
