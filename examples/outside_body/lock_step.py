"""What a body in Python needs of the protocol of docs/outside-body.md: frames in, answers out, a process a connection.

It imports nothing of p2os, and knows no engine: `main` takes a class with the methods of `REQUESTS`, `cast` and
`sizes`, and the exceptions that are an answer of `Failed`.
"""

import contextlib
import os
import signal
import socket
import struct
import sys
from pathlib import Path

#: Type of a request → the method of a body that answers it; the rest is answered here.
REQUESTS = {
    1: "hello", 2: "make_world", 3: "place", 5: "move", 6: "remove", 7: "reset", 8: "stand_at", 9: "step", 12: "save",
    13: "restore",
}  # fmt: skip
HELLO, RANGES, RAYS, BYE = 1, 10, 11, 14
#: Bytes of a Hello at most; a web browser that connects begins with what would be a longer one, or none.
LONGEST_HELLO = 1 << 16
ANSWER, FAILED = 0x80, 0xFF
RAYS_PER_SONAR = 9
#: What a body can, and what a wheel or the hull does.
SAVES, CASTS_RAYS = 1, 2
STALLED_LEFT, STALLED_RIGHT, TOUCHES = 1, 2, 4


class Fields:
    """The fields of a message, taken one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, layout):
        values = struct.unpack_from("<" + layout, self.data, self.at)
        self.at += struct.calcsize("<" + layout)
        return values

    def text(self):
        (size,) = self.take("H")
        (data,) = self.take(f"{size}s")
        return data.decode()


def text(words):
    return struct.pack("<H", len(words.encode())) + words.encode()


class Sizes:
    """What Hello says of the robot: metres, kilograms, newton metres, radians."""

    def __init__(self, fields):
        version, step_ns = fields.take("HI")
        if version != 1:
            raise ValueError("this body speaks version 1")
        self.step_s = step_ns / 1e9
        fields.text()
        self.track, wheel, self.clearance, self.height, self.mass, self.wheel_mass, self.torque = fields.take("7d")
        self.ring, self.longest, _, self.cone = fields.take("4d")
        self.radius = wheel / 2
        (corners,) = fields.take("H")
        hull = [fields.take("dd") for _ in range(corners)]
        self.front, self.rear = max(x for x, _ in hull), min(x for x, _ in hull)
        self.width = 2 * max(y for _, y in hull)
        (sonar,) = fields.take("H")
        self.sonar = [fields.take("ddd") for _ in range(sonar)]


def welcome(can, name, note):
    return struct.pack("<HH", 1, can) + text(name) + text(note)


def ranges(fields, sizes, cast):
    """Answer AskRanges: the nearest of some rays within each cone; `cast` has the distance and cosine of each ray."""
    (count,) = fields.take("H")
    aside = [sizes.cone / 2 * (2 * ray / (RAYS_PER_SONAR - 1) - 1) for ray in range(RAYS_PER_SONAR)]
    found = []
    for number in fields.take(f"{count}H"):
        x, y, heading = sizes.sonar[number]
        found.append(min(cast([(x, y, heading + each) for each in aside], sizes.longest))[0])
    return struct.pack(f"<H{count}d", count, *found)


def rays(fields, cast):
    """Answer AskRays."""
    longest, count = fields.take("dI")
    hits = cast([fields.take("ddd") for _ in range(count)], longest)
    return struct.pack("<I", count) + b"".join(struct.pack("<dd", *hit) for hit in hits)


def stepped(rows, report, touched, moved):
    """Return Stepped: wheel angles and bits a step, the report after the last, what was touched and pushed."""
    lists = (struct.pack("<H", len(one)) + b"".join(one) for one in (touched, moved))
    return struct.pack("<I", len(rows)) + b"".join(struct.pack("<ddB", *row) for row in rows) + report + b"".join(lists)


def answer(body, kind, fields):
    """Return the answer's fields."""
    if kind == RANGES:
        return ranges(fields, body.sizes, body.cast)
    if kind == RAYS:
        return rays(fields, body.cast)
    method = getattr(body, REQUESTS.get(kind, ""), None)
    if method is None and kind != BYE:
        raise ValueError(f"this body knows no request {kind}")
    return b"" if method is None else method(fields)


def serve(line, make, errors):
    """Answer each request of a connection that begins with Hello."""
    stream, body = line.makefile("rwb"), None
    while len(head := stream.read(5)) == 5:
        size, kind = struct.unpack("<IB", head)
        if body is None:
            if kind != HELLO or size > LONGEST_HELLO:
                print("connection refused: it begins with no Hello", file=sys.stderr, flush=True)
                return
            body = make()
        fields = Fields(stream.read(size - 1))
        try:
            payload, kind = answer(body, kind, fields), kind | ANSWER
        except (ValueError, KeyError, struct.error, *errors) as error:  # KeyError: a name
            payload, kind = text(str(error)), FAILED
        stream.write(struct.pack("<IB", len(payload) + 1, kind) + payload)
        stream.flush()


def listen(address):
    """Listen on unix:PATH or tcp:127.0.0.1:PORT, and say where."""
    scheme, _, place = address.partition(":")
    if scheme == "unix":
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(place)
    else:
        listener = socket.create_server(("127.0.0.1", int(place.removeprefix("127.0.0.1:"))))
        address = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
    listener.listen()
    print(f"listening on {address}", flush=True)
    return listener


def main(make, *errors):
    """Serve bodies at the address of the command line until a signal."""
    if len(sys.argv) != 2 or not sys.argv[1].startswith(("unix:", "tcp:127.0.0.1:")):
        sys.exit(f"usage: {Path(sys.argv[0]).name} unix:PATH|tcp:127.0.0.1:PORT")
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    listener = listen(sys.argv[1])
    while True:
        line, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            with contextlib.suppress(OSError):
                serve(line, make, errors)
            os._exit(0)
        line.close()
