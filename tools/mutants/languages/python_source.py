"""The mutants of a Python source, from its syntax tree; what it says in texts, types and decorators stays.

Sources: https://docs.python.org/3/library/ast.html (offsets of columns are in bytes of UTF-8).
"""

import ast
import itertools
import re
from collections.abc import Iterator, Sequence
from types import CodeType

from tools.mutants.languages.operators import COMPARISONS, FUNCTIONS, SIGNS, TRUTHS, WORDS_COMPARED, other_constants
from tools.mutants.mutant import Edit, SourceMutant, edited

_COMPARED = re.compile(rb"#[^\n]*|(?P<op>not\s+in\b|is\s+not\b|is\b|in\b|[<>=!]=|[<>])")
_SIGN = re.compile(rb"#[^\n]*|(?P<op>//|\*\*|<<|>>|[-+*/%&|^@])")
_JOINED = re.compile(rb"#[^\n]*|(?P<op>and\b|or\b)")
_SIMPLE = (ast.Raise, ast.Continue, ast.Break, ast.AugAssign, ast.Delete)
_LEAVING = (ast.Return, ast.Raise, ast.Continue, ast.Break)
_TEXTS = (ast.JoinedStr, ast.List, ast.Tuple, ast.Dict, ast.Set)

_Changes = Iterator[tuple[str, list[Edit]]]


def mutants(path: str, source: bytes) -> Iterator[SourceMutant]:
    """Go through every change of a module.

    Raises:
        SyntaxError: The source is no Python.
    """
    place = _Places(source)
    seen = set[tuple[Edit, ...]]()
    for node in _code_nodes(ast.parse(source)):
        for kind, edits in _changes(node, place):
            mutant = edited(path, source, kind, edits)
            if mutant.edits not in seen:
                seen.add(mutant.edits)
                yield mutant


def is_other_program(source: bytes, changed: bytes) -> bool:
    """Tell whether a change compiles, and to something else: neither line numbers nor documentation count."""
    try:
        return _code(changed) != _code(source)
    except (SyntaxError, ValueError):
        return False


class _Places:
    """Where the nodes of a source stand in it."""

    def __init__(self, source: bytes) -> None:
        self.source = source
        self._lines = [0, *itertools.accumulate(len(line) for line in source.splitlines(keepends=True))]

    def start(self, node: ast.expr | ast.stmt) -> int:
        return self._lines[node.lineno - 1] + node.col_offset

    def end(self, node: ast.expr | ast.stmt) -> int:
        return self._lines[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)

    def text(self, node: ast.expr | ast.stmt) -> bytes:
        return self.source[self.start(node) : self.end(node)]

    def replaced(self, node: ast.expr | ast.stmt, text: bytes) -> Edit:
        return Edit(start=self.start(node), end=self.end(node), text=text)

    def between(self, pattern: re.Pattern[bytes], left: ast.expr, right: ast.expr) -> tuple[int, int] | None:
        """Return where an operator stands between its operands."""
        for found in pattern.finditer(self.source, self.end(left), self.start(right)):
            if found["op"]:
                return found.span("op")
        return None

    def negated(self, test: ast.expr) -> list[Edit]:
        start, end = self.start(test), self.end(test)
        return [Edit(start=start, end=start, text=b"(not ("), Edit(start=end, end=end, text=b"))")]


def _code_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """Go through what is executed: no annotations, decorators, documentation, or what is for the type check."""
    for field, value in ast.iter_fields(tree):
        if field in {"annotation", "returns", "decorator_list", "type_params"}:
            continue
        for node in value if isinstance(value, list) else [value]:
            if not isinstance(node, ast.AST) or _is_for_readers(node):
                continue
            yield node
            yield from _code_nodes(node)


def _is_for_readers(node: ast.AST) -> bool:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
        return True
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return node.targets[0].id in {"__all__", "__slots__"}
    return False


def _changes(node: ast.AST, place: _Places) -> _Changes:  # noqa: C901, PLR0912 - a table by kind of node
    yield from _of_body(node, place)
    match node:
        case ast.Compare():
            yield from _comparisons(node, place)
        case ast.Constant():
            yield from _constants(node, place)
        case ast.BinOp(left=left, right=right) if not any(map(_is_text_or_type, (left, right))):
            yield from _sign(place.between(_SIGN, left, right), place)
        case ast.AugAssign(target=left, value=right) if not _is_text_or_type(right):
            yield from _sign(place.between(_SIGN, left, right), place)
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert(), operand=operand):
            yield "sign", [Edit(start=place.start(node), end=place.start(operand), text=b"")]
        case ast.BoolOp():
            yield from _joined(node, place)
        case ast.If(test=test) | ast.IfExp(test=test):
            if not (isinstance(test, ast.Compare) and len(test.ops) == 1):
                yield "branches", place.negated(test)
        case ast.comprehension(ifs=tests):
            for test in tests:
                yield "branches", place.negated(test)
        case ast.Call(func=ast.Name() | ast.Attribute() as called):
            name = called.id if isinstance(called, ast.Name) else called.attr
            if name in FUNCTIONS:
                end = place.end(called)
                yield "function", [Edit(start=end - len(name), end=end, text=FUNCTIONS[name].encode())]
    if isinstance(node, ast.stmt) and _may_drop(node):
        yield "dropped", [place.replaced(node, b"pass")]


def _comparisons(node: ast.Compare, place: _Places) -> _Changes:
    for left, right in itertools.pairwise([node.left, *node.comparators]):
        span = place.between(_COMPARED, left, right)
        if span is None:
            continue
        compared = " ".join(place.source[slice(*span)].decode().split())
        for other in (COMPARISONS | WORDS_COMPARED)[compared]:
            yield "comparison", [Edit(start=span[0], end=span[1], text=other.encode())]


def _constants(node: ast.Constant, place: _Places) -> _Changes:
    text = place.text(node).decode()
    if isinstance(node.value, bool):
        yield "constant", [place.replaced(node, TRUTHS[text].encode())]
    elif isinstance(node.value, int | float):
        for other in other_constants(text):
            yield "constant", [place.replaced(node, other.encode())]


def _sign(span: tuple[int, int] | None, place: _Places) -> _Changes:
    if span is not None and (other := SIGNS.get(place.source[slice(*span)].decode())):
        yield "sign", [Edit(start=span[0], end=span[1], text=other.encode())]


def _joined(node: ast.BoolOp, place: _Places) -> _Changes:
    other = b"or" if isinstance(node.op, ast.And) else b"and"
    spans = [place.between(_JOINED, left, right) for left, right in itertools.pairwise(node.values)]
    start, end = place.start(node), place.end(node)
    yield (
        "and or",
        [
            Edit(start=start, end=start, text=b"("),
            *(Edit(start=span[0], end=span[1], text=other) for span in spans if span is not None),
            Edit(start=end, end=end, text=b")"),
        ],
    )
    neutral = b"True" if isinstance(node.op, ast.And) else b"False"
    for value in node.values:
        if not any(isinstance(each, ast.NamedExpr) for each in ast.walk(value)):
            yield "check left out", [place.replaced(value, neutral)]


def _of_body(node: ast.AST, place: _Places) -> _Changes:
    """Exchange two checks that follow each other and leave, or two branches of an `elif`."""
    for field in ("body", "orelse", "finalbody"):
        body: Sequence[ast.AST] = getattr(node, field, None) or ()
        if not isinstance(body, list):
            continue
        for one, other in itertools.pairwise(body):
            if isinstance(one, ast.If) and isinstance(other, ast.If) and _leaves(one) and _leaves(other):
                texts = place.text(one), place.text(other)
                yield "order", [place.replaced(one, texts[1]), place.replaced(other, texts[0])]
    if isinstance(node, ast.If) and len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
        yield from _exchanged(node, node.orelse[0], place)


def _leaves(node: ast.If) -> bool:
    return not node.orelse and isinstance(node.body[-1], _LEAVING)


def _exchanged(one: ast.If, other: ast.If, place: _Places) -> _Changes:
    if not place.source[place.start(other) :].startswith(b"elif"):
        return
    spans = [(place.start(each.test), place.end(each.body[-1])) for each in (one, other)]
    texts = [place.source[slice(*span)] for span in spans]
    yield (
        "order",
        [Edit(start=start, end=end, text=text) for (start, end), text in zip(spans, reversed(texts), strict=True)],
    )


def _is_text_or_type(node: ast.expr) -> bool:
    """Tell whether no arithmetic is done with something; a type is a word that begins with a capital alone."""
    if isinstance(node, ast.BinOp):
        return _is_text_or_type(node.right)
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    is_type = name[:1].isupper() and not name.isupper()
    return is_type or isinstance(node, _TEXTS) or (isinstance(node, ast.Constant) and not _is_number(node.value))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)


def _may_drop(node: ast.stmt) -> bool:
    """Tell whether a statement can be left out and the rest still stands: what binds a local name cannot."""
    match node:
        case ast.Expr(value=ast.Call() | ast.Await() | ast.Yield() | ast.YieldFrom()):
            return True
        case ast.Assign(targets=targets):
            return all(isinstance(target, ast.Attribute | ast.Subscript) for target in targets)
        case ast.Return(value=value):
            return value is None
    return isinstance(node, _SIMPLE)


def _code(source: bytes) -> str:
    return repr(_parts(compile(source, "mutant", "exec", optimize=2, dont_inherit=True)))


def _parts(code: object) -> object:
    if not isinstance(code, CodeType):
        return type(code).__name__, code
    return code.co_code, code.co_names, code.co_varnames, tuple(_parts(constant) for constant in code.co_consts)
