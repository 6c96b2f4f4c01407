"""The mutants of a source in C or C++, from its tokens; a preprocessor's conditions and includes stay.

No grammar is known here: what does not compile is found by compiling it (natives.py).
"""

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from tools.mutants.languages.operators import COMPARISONS, FUNCTIONS, SIGNS, TRUTHS, other_constants
from tools.mutants.mutant import Edit, SourceMutant, edited

_TOKEN = re.compile(
    rb"""(?P<skipped>//[^\n]*|/\*.*?\*/|(?m:^[ \t]*\#[ \t]*(?!define\b)(?:[^\n\\]|\\.|\\\n)*))
      |(?P<text>(?:u8|[uUL])?"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)+')
      |(?P<number>\.?[0-9](?:[eEpP][+-]|'?[0-9a-zA-Z_.])*)
      |(?P<word>[A-Za-z_]\w*)
      |(?P<sign><<=|>>=|<=>|\.\.\.|->|::|\+\+|--|&&|\|\||<<|>>|[-+*/%&|^<>=!]=|[-+*/%&|^<>=!~?:;,.(){}[\]\#])
    """,
    re.DOTALL | re.VERBOSE,
)
_LEAVING = {b"return", b"break", b"continue", b"goto"}
_OPENING, _CLOSING = {b"(", b"[", b"{"}, {b")", b"]", b"}"}
_JOINED = {b"&&": b"||", b"||": b"&&"}
_COUNTED = {b"++": b"--", b"--": b"++"}
#: What may stand second in a statement that acts: the first word is then no type.
_ACTING = {b"(", b".", b"->", b"[", b"=", b"++", b"--", b"+=", b"-=", b"*=", b"/=", b"|=", b"&=", b"^=", b"<<=", b">>="}

_Changes = Iterator[tuple[str, list[Edit]]]


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: bytes
    start: int

    @property
    def end(self) -> int:
        return self.start + len(self.text)

    def replaced(self, text: str | bytes) -> list[Edit]:
        return [Edit(start=self.start, end=self.end, text=text.encode() if isinstance(text, str) else text)]


def mutants(path: str, source: bytes) -> Iterator[SourceMutant]:
    """Go through every change of a file; not every one compiles."""
    tokens = [
        _Token(str(found.lastgroup), found[0], found.start())
        for found in _TOKEN.finditer(source) if found.lastgroup != "skipped"
    ]  # fmt: skip
    seen = set[tuple[Edit, ...]]()
    for kind, edits in (*_of_tokens(tokens, source), *_of_statements(tokens, source)):
        mutant = edited(path, source, kind, edits)
        if mutant.edits not in seen:
            seen.add(mutant.edits)
            yield mutant


def _of_tokens(tokens: list[_Token], source: bytes) -> _Changes:  # noqa: C901 - a table by kind of token
    for before, token in pairwise(tokens):
        text = token.text.decode()
        is_spaced = source[token.start - 1 : token.start].isspace() and source[token.end : token.end + 1].isspace()
        is_between = before.kind in {"word", "number"} or before.text in {b")", b"]"}
        if token.kind == "number":
            for other in other_constants(text):
                yield "constant", token.replaced(other)
        elif text in TRUTHS:
            yield "constant", token.replaced(TRUTHS[text])
        elif text in FUNCTIONS and before.text not in {b".", b"->"}:
            yield "function", token.replaced(FUNCTIONS[text])
        elif token.text in _JOINED and is_spaced:
            yield "and or", token.replaced(_JOINED[token.text])
        elif token.text in _COUNTED:
            yield "sign", token.replaced(_COUNTED[token.text])
        elif text in COMPARISONS and is_spaced:  # a template's bracket has no space before it
            for other in COMPARISONS[text]:
                yield "comparison", token.replaced(other)
        elif text in SIGNS and is_spaced and is_between and before.text != b"return":
            yield "sign", token.replaced(SIGNS[text])
        elif text.removesuffix("=") in SIGNS and text.endswith("=") and is_spaced:
            yield "sign", token.replaced(f"{SIGNS[text.removesuffix('=')]}=")
        elif token.text in {b"-", b"!", b"~"} and not is_between:
            yield "sign", token.replaced(b"")


def _of_statements(tokens: list[_Token], source: bytes) -> _Changes:
    closing = _closing(tokens)
    checks: dict[int, int] = {}  # where a check that leaves begins, and where it ends
    for place, token in enumerate(tokens):
        is_first = place > 0 and tokens[place - 1].text in {b";", b"{", b"}"}
        if token.text == b"if" and tokens[place + 1].text == b"(" and place + 1 in closing:
            end = closing[place + 1]
            condition = tokens[place + 2 : end]
            if len({*COMPARISONS} & {each.text.decode() for each in condition}) != 1 or any(
                each.text in _JOINED for each in condition
            ):
                first, last = tokens[place + 1].end, tokens[end].start
                yield "branches", [Edit(start=first, end=first, text=b"!("), Edit(start=last, end=last, text=b")")]
            if is_first and (last_of_check := _end_of_check(tokens, end + 1, closing)) is not None:
                checks[place] = last_of_check
        elif is_first and token.kind == "word" and place + 1 < len(tokens) and tokens[place + 1].text in (
            {b";"} if token.text in _LEAVING else _ACTING
        ) and token.text not in {b"for", b"while", b"switch", b"if"}:  # fmt: skip
            semicolon = _end_of_statement(tokens, place, closing)
            if semicolon is not None:
                yield "dropped", [Edit(start=token.start, end=tokens[semicolon].end, text=b";")]
    for one, end in checks.items():
        if (other := end + 1) in checks:
            spans = [(tokens[one].start, tokens[end].end), (tokens[other].start, tokens[checks[other]].end)]
            texts = [source[slice(*span)] for span in spans]
            yield (
                "order",
                [Edit(start=start, end=end, text=text) for (start, end), text in zip(spans, texts[::-1], strict=True)],
            )


def _closing(tokens: list[_Token]) -> dict[int, int]:
    """Return where each bracket is closed."""
    found, opened = dict[int, int](), list[int]()
    for place, token in enumerate(tokens):
        if token.kind == "sign" and token.text in _OPENING:
            opened.append(place)
        elif token.kind == "sign" and token.text in _CLOSING and opened:
            found[opened.pop()] = place
    return found


def _end_of_statement(tokens: list[_Token], place: int, closing: dict[int, int]) -> int | None:
    """Return the semicolon of a statement; None where it is a block's head."""
    while place < len(tokens):
        text = tokens[place].text
        if text == b";":
            return place
        if text in _CLOSING:
            return None
        if text == b"{" and tokens[place - 1].text == b")":
            return None
        place = closing.get(place, place) + 1
    return None


def _end_of_check(tokens: list[_Token], place: int, closing: dict[int, int]) -> int | None:
    """Return the end of what an `if` guards, where that leaves and nothing is else."""
    if place >= len(tokens):
        return None
    if tokens[place].text == b"{" and place in closing:
        end = closing[place]
        ends = [each for each in range(place, end) if tokens[each].text == b";"]
        starts = [each for each in range(place, end) if tokens[each].text in _LEAVING]
        leaves = bool(ends and starts) and bisect_left(ends, starts[-1]) == len(ends) - 1
    else:
        found = _end_of_statement(tokens, place, closing)
        if found is None:
            return None
        end, leaves = found, tokens[place].text in _LEAVING
    has_else = end + 1 < len(tokens) and tokens[end + 1].text == b"else"
    return end if leaves and not has_else else None
