"""What each worker of xdist runs first: tests/tools/suite/forked_workers.py has the others forked from one of them.

Its source is sent to a process that has imported execnet only, with `FIRST`, the name of the worker that runs tests
itself, and `REMOTE`, the source of `xdist.remote`.
"""

import os
import socket
import time
from contextlib import suppress
from typing import Any

import execnet

#: The socket in the folder of the run, and for how long it may be missing, in seconds, until one looks no more.
SOCKET, BEGIN_S, LOOK_S = "workers", 60.0, 0.05


def run(channel: Any, first: str, remote: str) -> None:
    """Be a worker: hand the pipes from and to the controller over, or run what xdist does.

    Args:
        channel: To the controller, execnet's, which has sent what `xdist.remote` reads first.
        first: The name of the worker that others hand their pipes to.
        remote: The source of `xdist.remote`.
    """
    given = channel.receive()
    workerinput, _, options, _ = given
    if workerinput["workerid"] != first and options.get("basetemp"):
        hand_over(channel, workerinput, options["basetemp"])
    channel._items.put(given)  # for xdist, which reads it itself
    exec(remote, {"__name__": "__channelexec__", "channel": channel})  # noqa: S102


def hand_over(channel: Any, workerinput: dict[str, Any], basetemp: str) -> None:
    """Give the pipes to the first worker and end; return where it takes none."""
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as line:
        until = time.monotonic() + BEGIN_S
        while True:
            try:
                line.connect(os.path.join(os.path.dirname(basetemp), SOCKET))  # noqa: PTH118, PTH120 - no more modules
                break
            except FileNotFoundError:  # it has not begun
                if time.monotonic() > until:
                    return
                time.sleep(LOOK_S)
        pipes = channel.gateway._io
        message = execnet.dumps({"workerinput": workerinput, "basetemp": basetemp})
        socket.send_fds(line, [message], [pipes.infile.fileno(), pipes.outfile.fileno()])
        if line.recv(1):
            os._exit(0)  # at once: this process must read no more of what comes


if __name__ == "__channelexec__":
    run(channel, FIRST, REMOTE)  # type: ignore[name-defined]  # noqa: F821 - put there by who sends it
