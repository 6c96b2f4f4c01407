"""A small XML tree that a hostile file cannot blow up.

A document type declaration is refused, so there are no entities to expand and
nothing is fetched; the number of elements and their depth are bounded.

Over expat of the standard library, and not lxml or defusedxml: lxml (12 MB) builds its tree before the
elements can be counted and drops entities without a word; defusedxml knows no line to name.
"""

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat  # declarations are refused below

from p2os.errors import WorldError
from simbase.errors import shown, shown_name
from simbase.files import read_bytes

MOST_ELEMENTS = 200_000
DEEPEST = 64


@dataclass(slots=True)
class Element:
    """One element: its name without a namespace, its text, and its line."""

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list["Element"] = field(default_factory=list)

    def all(self, tag: str) -> list["Element"]:
        """Return the children of a name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, *path: str) -> "Element | None":
        """Return the first descendant along a path of names, or None."""
        here: Element | None = self
        for tag in path:
            here = None if here is None else next((child for child in here.children if child.tag == tag), None)
        return here

    def get(self, name: str, default: str = "") -> str:
        """Return an attribute."""
        return self.attributes.get(name, default)


class _Builder:
    """Takes the parser's events."""

    def __init__(self, parser: expat.XMLParserType, where: str) -> None:
        self._parser, self._where = parser, where
        self.root: Element | None = None
        self._open: list[Element] = []
        self._count = 0

    def refuse(self, *_: object) -> None:
        raise WorldError(
            f"{self._where}:{self._parser.CurrentLineNumber}: a document type declaration is refused",
            hint="take the <!DOCTYPE ...> out",
        )

    def begin(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MOST_ELEMENTS or len(self._open) >= DEEPEST:
            raise WorldError(
                f"{self._where}:{self._parser.CurrentLineNumber}: more than {MOST_ELEMENTS} elements, "
                f"or more than {DEEPEST} within each other",
                hint="make it simpler first",
            )
        element = Element(name.rsplit(" ", 1)[-1], attributes, self._parser.CurrentLineNumber)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def end(self, _name: str) -> None:
        self._open.pop()

    def characters(self, text: str) -> None:
        if self._open:
            self._open[-1].text += text


def read_xml(path: Path, *roots: str) -> Element:
    """Return the root of an XML file.

    Args:
        path: The file.
        roots: The names that its root may have.

    Raises:
        WorldError: The file is no XML, is hostile, or has another root.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    builder = _Builder(parser, str(path))
    parser.StartDoctypeDeclHandler = builder.refuse
    parser.StartElementHandler = builder.begin
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.characters
    try:
        parser.Parse(read_bytes(path, WorldError), True)
    except expat.ExpatError as error:
        raise WorldError(
            f"{path}:{error.lineno}: {expat.ErrorString(error.code)}", hint="the file is not XML"
        ) from error
    except (ValueError, LookupError) as error:
        raise WorldError(f"{path}: {error}", hint="the file is not XML") from error
    root = builder.root
    if root is None or root.tag not in roots:
        found = "nothing" if root is None else f"<{shown_name(root.tag)}>"
        raise WorldError(f"{path}: expected <{'> or <'.join(roots)}>, got {found}")
    return root


def numbers(element: Element, text: str, path: Path, count: int | None = None) -> list[float]:
    """Return the finite numbers of a text.

    Args:
        element: Where they stand, for the message.
        text: The numbers, between blanks.
        path: The file, for the message.
        count: How many there must be; None for any.

    Raises:
        WorldError: One is no number or not finite, or there are not so many.
    """
    words = text.split()
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise WorldError(
            f"{path}:{element.line}: <{shown_name(element.tag)}>: {shown(text.strip())} is no number"
        ) from error
    if count is not None and len(values) != count:
        raise WorldError(f"{path}:{element.line}: <{element.tag}> needs {count} numbers, got {len(values)}")
    if not all(-1e300 < value < 1e300 for value in values):
        raise WorldError(f"{path}:{element.line}: <{element.tag}> has a number that is not finite")
    return values
