"""Parts of a system, or of a library, that are acted: every call is noted, and answered from a list where there is one.

calls: list[str] = []
port = Acted(calls, "port", read=[b"abc", OSError(5, "gone")])
port.read(4096)  # b"abc"; calls == ["port.read(4096)"]
"""

from collections.abc import Callable, Sequence
from typing import Any

from tests.tools.suite.approved import said

#: Longer bytes are shown by their number.
SHOWN_BYTES = 20


class Acted:
    """Whatever its methods are called, each notes how it is called, and returns or raises the next answer, or None.

    Args:
        calls: Where calls are noted.
        name: What it is called there; "" for nothing.
        answers: Of each method, one after the other; a function is called with what the method was given.
    """

    def __init__(self, calls: list[str], name: str = "", /, **answers: Sequence[object]) -> None:
        self._calls, self._name = calls, name
        self._answers = {method: [*given] for method, given in answers.items()}

    def __str__(self) -> str:
        return self._name

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("__"):
            raise AttributeError(name)
        whole = f"{self._name}.{name}" if self._name else name

        def call(*arguments: object, **named: object) -> Any:
            self._calls.append(f"{whole}{said([*map(_shown, arguments)])}{said(named) if named else ''}")
            given = self._answers.get(name)
            answer = given.pop(0) if given else None
            if isinstance(answer, BaseException):
                raise answer
            return answer(*arguments) if callable(answer) else answer

        return call


def taken(calls: list[str]) -> str:
    """Return the calls as a text, and forget them."""
    found, calls[:] = said(calls), []
    return found


def _shown(argument: object) -> object:
    is_long = isinstance(argument, bytes) and len(argument) > SHOWN_BYTES
    return f"{len(argument)} bytes" if is_long else argument  # type: ignore[arg-type]  # it has a length then
