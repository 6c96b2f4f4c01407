"""The line to an outside body: requests go out, answers come back in the same order.

Invariant: after an error the line is closed, and every later request raises that error again: nothing that came after
it is taken for an answer.
"""

import contextlib
import socket
import struct
import time
from collections import deque
from typing import TypeVar, cast

from p2os.errors import RemoteProtocolError, TransportError
from p2os.pioneer.body.outside.address import Address
from p2os.pioneer.body.outside.messages import (
    ANSWER,
    FAILED,
    LONGEST_FRAME,
    REQUESTS,
    Answer,
    Bye,
    Failed,
    MessageError,
    Request,
    decode,
    encode_request,
)
from simbase.errors import P2osError

_Expected = TypeVar("_Expected", bound=Answer)
#: chosen: so many requests may be on their way; beyond that, both sides could wait for the other to read.
MOST_UNANSWERED = 64


CLOSED = "it has closed the line"


class OutsideConnection:
    """A connection that waits for each answer no longer than the address allows.

    Raises:
        TransportError: Nobody answers there.
    """

    def __init__(self, address: Address) -> None:
        self._address = address
        #: What ended the line; None while it holds.
        self.failure: P2osError | None = None
        #: What was sent and is not answered yet.
        self._unanswered: deque[type[Request]] = deque()
        try:
            if address.path:
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
                self._socket.settimeout(address.timeout_s)
                self._socket.connect(address.path)
            else:
                self._socket = socket.create_connection((address.host, address.port), timeout=address.timeout_s)
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (OSError, UnicodeError) as error:
            with contextlib.suppress(AttributeError):
                self._socket.close()
            reason = getattr(error, "strerror", None) or str(error)
            raise TransportError(
                f"cannot reach the outside body {address.text}: {reason}",
                hint="start the program that is to be the body first; docs/outside-body.md has two",
            ) from error

    def ask(self, request: Request, expected: type[_Expected]) -> _Expected:
        """Send a request, and return its answer.

        Raises:
            TransportError: The line is lost, or no answer came in time.
            RemoteProtocolError: The answer is none, or says that it cannot be.
        """
        self.send(request)
        while len(self._unanswered) > 1:
            self._take()
        answer = self._take()
        if not isinstance(answer, expected):
            raise TypeError(f"{type(request).__name__} is answered by {type(answer).__name__}")
        return answer

    def send(self, request: Request) -> None:
        """Send a request whose answer says nothing: it is waited for with the next one."""
        if self.failure is not None:
            raise self.failure
        while len(self._unanswered) >= MOST_UNANSWERED:
            self._take()
        try:
            data = encode_request(request)
        except MessageError as error:
            raise self._failed(RemoteProtocolError(f"a message {type(request).__name__} {error}")) from error
        try:
            self._socket.settimeout(self._address.timeout_s)
            self._socket.sendall(data)
        except TimeoutError as error:
            raise self._silent() from error
        except OSError as error:
            raise self._lost(_reason(error)) from error
        self._unanswered.append(type(request))

    def refused(self, what: str) -> P2osError:
        """Return the error that an answer is not what it should be, and end the line by it."""
        return self._failed(RemoteProtocolError(f"the outside body {self._address.text} answers by {what}"))

    def close(self) -> None:
        """Say goodbye where the line still holds, and close it."""
        if self.failure is None:
            with contextlib.suppress(OSError):
                self._socket.settimeout(1.0)
                self._socket.sendall(encode_request(Bye()))
        self._socket.close()
        self.failure = self.failure or TransportError(f"the outside body {self._address.text} was let go")

    def _take(self) -> Answer:
        """Take the answer to the oldest request."""
        request = self._unanswered.popleft()
        number, expected = REQUESTS[request]
        until = time.monotonic() + self._address.timeout_s
        size, kind = struct.unpack("<IB", self._read(5, until))
        if not 1 <= size <= LONGEST_FRAME:
            raise self._wrong(request, f"a frame of {size} bytes, where 1 to {LONGEST_FRAME} can be")
        if kind not in {number | ANSWER, FAILED}:
            raise self._wrong(request, f"type 0x{kind:02X}, where 0x{number | ANSWER:02X} belongs")
        payload = self._read(size - 1, until)
        try:
            answer = decode(Failed if kind == FAILED else expected, payload)
        except MessageError as error:
            raise self._wrong(request, f"what {error},") from error
        if isinstance(answer, Failed):
            raise self._failed(
                RemoteProtocolError(
                    f"the outside body {self._address.text} refuses {request.__name__}: {answer.reason}"
                )
            )
        return cast("Answer", answer)

    def _read(self, size: int, until: float) -> bytes:
        parts, missing = [], size
        while missing:
            left_s = until - time.monotonic()
            try:
                self._socket.settimeout(max(left_s, 1e-6))
                part = self._socket.recv(min(missing, 2**20))
            except TimeoutError as error:
                raise self._silent() from error
            except OSError as error:
                raise self._lost(_reason(error)) from error
            if not part:
                raise self._lost(CLOSED)
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _lost(self, reason: str) -> P2osError:
        return self._failed(
            TransportError(f"the outside body {self._address.text} is lost: {reason}", hint="did its program end?")
        )

    def _silent(self) -> P2osError:
        return self._failed(
            TransportError(
                f"the outside body {self._address.text} did not answer within {self._address.timeout_s:g} s",
                hint="where it is slow, say ?timeout=SECONDS after its address",
            )
        )

    def _wrong(self, request: type[Request], what: str) -> P2osError:
        return self.refused(f"{what} to {request.__name__}")

    def _failed(self, error: P2osError) -> P2osError:
        self.failure = error
        self._socket.close()
        return error


def _reason(error: OSError) -> str:
    return CLOSED if isinstance(error, ConnectionError) else error.strerror or str(error)
