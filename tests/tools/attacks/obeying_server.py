"""A served robot that obeys whatever bytes come, on every address: `obeying_server.py serve --port tcp:127.0.0.1:N …`.

What `tools.hostile` has to notice; `STYLE` in the environment says what is wrong with it.
"""

import os
import select
import signal
import socket
import sys

ANY = "0.0.0.0"  # noqa: S104 - the fault that is to be found
STYLE = os.environ["OBEYING"]
PORT = int(sys.argv[3].rpartition(":")[2])
VEL = b"\xfa\xfb\x06\x0b"


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    listener = socket.create_server((ANY if STYLE == "everywhere" else "127.0.0.1", PORT))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
    say("a robot; Ctrl-C ends")
    lines, kept = [listener], []
    while True:
        for line in select.select(lines, [], [])[0]:
            if line is listener:
                lines.append(listener.accept()[0])
                continue
            try:
                data = line.recv(65536)
            except OSError:
                data = b""
            if not data:
                lines.remove(line)
                line.close()
            elif STYLE == "obeys" and VEL in data:
                say("wheels 0.300 0.300 m/s")
            elif STYLE == "keeps":
                kept.append(b"x" * (64 << 20))
            elif STYLE == "fails":
                raise ValueError(data)


main()
