"""The kinds of faults that are planted, how often each is met in the field, and where in a C source each can stand.

Source of kinds and shares: J. A. Duraes, H. S. Madeira, "Emulation of Software Faults: A Field Data Study and a
Practical Approach", IEEE Transactions on Software Engineering 32(11), 2006: the twelve most frequent of 668 faults that
were mended in C programs, 50.69 % of all. Nothing is chosen here but how a kind is written as an edit of text.

A place is a range of bytes of a file and what takes its place; tree-sitter's grammar of C finds them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from tree_sitter import Language, Node, Parser
from tree_sitter_c import language


@dataclass(frozen=True, slots=True)
class SourceEdit:
    """A range of bytes of a source, and what takes its place."""

    start: int
    end: int
    text: bytes


@dataclass(frozen=True, slots=True)
class PlantedKind:
    """A kind of fault.

    Args:
        says: What is wrong, in the words of the source.
        percent: Of the faults of the field.
        places: Of a node of the tree the edits that it allows.
    """

    says: str
    percent: float
    places: Callable[[Node], Iterator[SourceEdit]]


#: Wrong in place of right, in conditions and in sums.
RELATIONS: Mapping[bytes, tuple[bytes, ...]] = {
    b"<": (b"<=", b">"), b"<=": (b"<", b">="), b">": (b">=", b"<"), b">=": (b">", b"<="), b"==": (b"!=",),
    b"!=": (b"==",), b"&&": (b"||",), b"||": (b"&&",),
}  # fmt: skip
SUMS: Mapping[bytes, tuple[bytes, ...]] = {
    b"+": (b"-",), b"-": (b"+",), b"*": (b"/",), b"/": (b"*",), b"%": (b"/",), b"<<": (b">>",), b">>": (b"<<",),
    b"&": (b"|",), b"|": (b"&",),
}  # fmt: skip
#: What gives a number to something.
_GIVING = frozenset({"assignment_expression", "init_declarator", "initializer_pair", "initializer_list"})
_CONDITIONED = frozenset({"if_statement", "while_statement", "do_statement", "for_statement", "conditional_expression"})


def places(source: bytes, kind: PlantedKind) -> list[SourceEdit]:
    """Return every edit of a kind that a source allows, in its order."""
    waiting, found = [Parser(Language(language())).parse(source).root_node], list[SourceEdit]()
    while waiting:
        node = waiting.pop()
        found += kind.places(node)
        waiting += node.children
    return sorted(set(found), key=lambda place: (place.start, place.end, place.text))


def _gone(first: Node, last: Node | None = None) -> SourceEdit:
    return SourceEdit(first.start_byte, (last or first).end_byte, b";")


def _text(node: Node) -> bytes:
    return node.text or b""


def _in_condition(node: Node) -> bool:
    """Return whether an expression decides a branch; what a predicate returns does so for its caller."""
    above = node.parent
    while above is not None and above.type in {"parenthesized_expression", "binary_expression", "unary_expression"}:
        node, above = above, above.parent
    if above is None:
        return False
    return above.type == "return_statement" or (
        above.type in _CONDITIONED and above.child_by_field_name("condition") == node
    )


def _bare_ifs(node: Node) -> Iterator[Node]:
    if node.type == "if_statement" and node.child_by_field_name("alternative") is None:
        yield node


def missing_if_with_statements(node: Node) -> Iterator[SourceEdit]:
    """MIFS."""
    yield from map(_gone, _bare_ifs(node))


def missing_if_around(node: Node) -> Iterator[SourceEdit]:
    """MIA."""
    for found in _bare_ifs(node):
        body = found.child_by_field_name("consequence")
        if body is not None:
            yield SourceEdit(found.start_byte, body.start_byte, b"")


def missing_call(node: Node) -> Iterator[SourceEdit]:
    """MFC: the result of the call is not used."""
    if (
        node.type == "expression_statement"
        and node.named_children[:1]
        and node.named_children[0].type == "call_expression"
    ):
        yield _gone(node)


def missing_and(node: Node) -> Iterator[SourceEdit]:
    """MLAC: either side of an AND."""
    operator = node.child_by_field_name("operator")
    if node.type == "binary_expression" and operator is not None and _text(operator) == b"&&" and _in_condition(node):
        for side in ("left", "right"):
            kept = node.child_by_field_name(side)
            if kept is not None:
                yield SourceEdit(node.start_byte, node.end_byte, _text(kept))


def missing_part(node: Node) -> Iterator[SourceEdit]:
    """MLPC: two to five statements that follow one another."""
    if node.type != "compound_statement":
        return
    rows = node.named_children
    for first in range(len(rows)):
        for count in range(2, 6):
            part = rows[first : first + count]
            if len(part) == count and all(one.type == "expression_statement" for one in part):
                yield _gone(part[0], part[-1])


def _assignments(node: Node, *, literal: bool) -> Iterator[Node]:
    if node.type == "expression_statement" and node.named_children[:1]:
        inner = node.named_children[0]
        right = inner.child_by_field_name("right")
        if inner.type == "assignment_expression" and right is not None and _is_literal(right) == literal:
            yield node


def _is_literal(node: Node) -> bool:
    return node.type in {"number_literal", "true", "false", "char_literal"} or (
        node.type == "identifier" and _text(node).isupper()
    )


def missing_assignment_of_expression(node: Node) -> Iterator[SourceEdit]:
    """MVAE."""
    yield from map(_gone, _assignments(node, literal=False))


def missing_assignment_of_value(node: Node) -> Iterator[SourceEdit]:
    """MVAV."""
    yield from map(_gone, _assignments(node, literal=True))


def missing_initialization(node: Node) -> Iterator[SourceEdit]:
    """MVI."""
    if node.type == "init_declarator":
        name = node.child_by_field_name("declarator")
        if name is not None:
            yield SourceEdit(name.end_byte, node.end_byte, b"")


def _operators(node: Node, wrong: Mapping[bytes, tuple[bytes, ...]]) -> Iterator[SourceEdit]:
    operator = node.child_by_field_name("operator")
    if node.type == "binary_expression" and operator is not None:
        for text in wrong.get(_text(operator), ()):
            yield SourceEdit(operator.start_byte, operator.end_byte, text)


def wrong_condition(node: Node) -> Iterator[SourceEdit]:
    """WLEC."""
    if _in_condition(node):
        yield from _operators(node, RELATIONS)


def wrong_value(node: Node) -> Iterator[SourceEdit]:
    """WVAV: a number that is given to something, by its name or as a macro: one more, one less, or its half."""
    if node.type == "preproc_def":
        value = node.child_by_field_name("value")
        if value is None:
            return
        # The grammar keeps a macro's text whole, a comment behind it included.
        text = _text(value)
        digits = text.split(b" ")[0].split(b"\t")[0].rstrip(b"u")
        yield from _other_numbers(value.start_byte, digits)
    elif node.type == "number_literal":
        above = node.parent
        if above is not None and above.type in {
            "assignment_expression",
            "init_declarator",
            "initializer_pair",
            "initializer_list",
        }:
            yield from _other_numbers(node.start_byte, _text(node).rstrip(b"u"))


def _other_numbers(start: int, digits: bytes) -> Iterator[SourceEdit]:
    if digits.isdigit():
        value = int(digits)
        for other in sorted({value + 1, value - 1, value // 2, value * 2} - {value}):
            if other >= 0:
                yield SourceEdit(start, start + len(digits), str(other).encode())


def _arguments(node: Node) -> Iterator[Node]:
    above = node.parent
    while above is not None and above.type in {"binary_expression", "parenthesized_expression", "argument_list"}:
        if above.type == "argument_list":
            yield node
            return
        above = above.parent


def wrong_sum_in_argument(node: Node) -> Iterator[SourceEdit]:
    """WAEP."""
    for found in _arguments(node):
        yield from _operators(found, SUMS)


def wrong_variable_in_argument(node: Node) -> Iterator[SourceEdit]:
    """WPFV: another variable of its function; what does not compile is left to the compiler."""
    if node.type != "identifier" or node.parent is None or node.parent.type != "argument_list":
        return
    function: Node | None = node.parent
    while function is not None and function.type != "function_definition":
        function = function.parent
    if function is not None:
        for name in sorted(_variables(function) - {_text(node)}):
            yield SourceEdit(node.start_byte, node.end_byte, name)


def _variables(function: Node) -> set[bytes]:
    found, waiting = set[bytes](), [function]
    while waiting:
        node = waiting.pop()
        name: Node | None = node.child_by_field_name("declarator")
        if node.type in {"parameter_declaration", "init_declarator", "pointer_declarator", "declaration"}:
            while name is not None and name.type == "pointer_declarator":
                name = name.child_by_field_name("declarator")
            if name is not None and name.type == "identifier":
                found.add(_text(name))
        waiting += node.children
    return found


KINDS: Mapping[str, PlantedKind] = {
    "MIFS": PlantedKind("missing if construct plus statements", 9.96, missing_if_with_statements),
    "MFC": PlantedKind("missing function call", 8.64, missing_call),
    "MLAC": PlantedKind("missing AND in an expression used as branch condition", 7.89, missing_and),
    "MIA": PlantedKind("missing if construct around statements", 4.32, missing_if_around),
    "MLPC": PlantedKind("missing small and localized part of the algorithm", 3.19, missing_part),
    "MVAE": PlantedKind("missing variable assignment using an expression", 3.00, missing_assignment_of_expression),
    "WLEC": PlantedKind("wrong logical expression used as branch condition", 3.00, wrong_condition),
    "WVAV": PlantedKind("wrong value assigned to variable", 2.44, wrong_value),
    "MVI": PlantedKind("missing variable initialization", 2.25, missing_initialization),
    "MVAV": PlantedKind("missing variable assignment using a value", 2.25, missing_assignment_of_value),
    "WAEP": PlantedKind("wrong arithmetic expression in parameter of function call", 2.25, wrong_sum_in_argument),
    "WPFV": PlantedKind("wrong variable used in parameter of function call", 1.50, wrong_variable_in_argument),
}
