"""XML as text: elements within each other, numbers with every digit."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr


@dataclass(slots=True)
class Tag:
    """An element to be written: its attributes, and its text or its children."""

    name: str
    attributes: dict[str, str] = field(default_factory=dict)
    text: str = ""
    children: list["Tag"] = field(default_factory=list)

    def add(self, tag: str, text: str = "", /, **attributes: str) -> "Tag":
        """Add a child and return it."""
        child = Tag(tag, attributes, text)
        self.children.append(child)
        return child

    def lines(self, indent: str = "") -> Iterable[str]:
        """Yield the lines of the element."""
        head = self.name + "".join(f" {key}={quoteattr(value)}" for key, value in self.attributes.items())
        if self.children:
            yield f"{indent}<{head}>"
            for child in self.children:
                yield from child.lines(f"{indent}  ")
            yield f"{indent}</{self.name}>"
        elif self.text:
            yield f"{indent}<{head}>{escape(self.text)}</{self.name}>"
        else:
            yield f"{indent}<{head}/>"

    def document(self) -> bytes:
        """Return the file whose root it is."""
        return ('<?xml version="1.0" encoding="utf-8"?>\n' + "\n".join(self.lines()) + "\n").encode()


def spaced(values: Iterable[float]) -> str:
    """Return numbers with blanks between them, each with all its digits."""
    return " ".join(repr(float(value) + 0.0) for value in values)
