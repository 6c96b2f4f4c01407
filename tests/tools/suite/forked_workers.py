"""Workers of xdist that are forked from the first of them when it has collected all.

To collect all tests of the project takes a process 10 s of processor time, more where lines are counted. The controller
starts its workers as ever, and has them run forked_workers_client.py first. All but one hand the pipes from and to the
controller over to that one and end; it runs `xdist.remote`, and forks for each of them before the first test. A forked
process reads and writes the pipes of the worker that it stands for, under its name.

A worker that comes late, in place of one that has crashed, or finds none to hand over to (no such sockets, too long a
path) collects by itself. Which tests run where is left to xdist.
"""

import inspect
import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any

import execnet
import pytest
import xdist.remote
from execnet.gateway_base import Popen2IO, WorkerPool

from tests.tools.suite import forked_workers_client
from tests.tools.suite.fewer_messages import interactor_of
from tests.tools.suite.forked_workers_client import SOCKET

#: The worker that collects.
FIRST = "gw0"
#: For how long it waits for each of the others once it has collected, in seconds; the longest message, in bytes.
COME_S, MOST_BYTES = 10.0, 1 << 16


class Controller:
    """A plugin of the controller."""

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_getremotemodule(self) -> str:
        """Return the source that each worker runs."""
        client, remote = inspect.getsource(forked_workers_client), inspect.getsource(xdist.remote)
        return f"FIRST, REMOTE = {FIRST!r}, {remote!r}\n{client}"


class FirstWorker:
    """A plugin of the first worker: listens from the beginning, and forks before the first test."""

    def __init__(self, config: Any) -> None:
        self._config = config
        self._workers = int(config.workerinput["workercount"])
        self._forked: list[int] = []
        self._listener: socket.socket | None = None
        if self._workers > 1 and config.option.basetemp:
            with suppress(OSError, AttributeError):  # a platform has no such sockets
                listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                listener.bind(str(Path(config.option.basetemp).parent / SOCKET))
                listener.listen()
                listener.settimeout(COME_S)
                self._listener = listener

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> None:
        """Fork for each of the others; the loop goes on in all processes.

        What is captured is written to files, whose ends all processes would share: capturing begins anew in each.
        """
        if self._listener is None:
            return
        capture = self._config.pluginmanager.getplugin("capturemanager")
        capture.stop_global_capturing()
        with self._listener:
            for _ in range(self._workers - 1):
                if self._fork(self._listener, session):
                    break
        capture.start_global_capturing()
        capture.suspend_global_capture()

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self) -> None:
        """Wait for what was forked, as the controller would for its processes."""
        for process in self._forked:
            os.waitpid(process, 0)

    def _fork(self, listener: socket.socket, session: pytest.Session) -> bool:
        """Fork for the worker that comes next, if one does; tell whether this is the forked process."""
        try:
            line, _ = listener.accept()
        except TimeoutError:
            return False
        with line:
            message, pipes, _, _ = socket.recv_fds(line, MOST_BYTES, 2)
            process = os.fork()
            if process:
                self._forked.append(process)
                for each in pipes:
                    os.close(each)
                return False
            self._forked.clear()
            line.sendall(b"taken")
            line.recv(1)  # until it has ended, and reads no more
        self._become(session, pipes, **execnet.loads(message))
        return True

    def _become(self, session: pytest.Session, pipes: list[int], workerinput: dict[str, Any], basetemp: str) -> None:
        """Be another worker, as the controller, the tests and plug-ins see it."""
        config = self._config
        config.workerinput.update(workerinput)
        os.environ["PYTEST_XDIST_WORKER"] = workerinput["workerid"]
        config.option.basetemp = basetemp
        config._tmp_path_factory._given_basetemp = Path(basetemp)
        config._tmp_path_factory._basetemp = None
        interactor = interactor_of(config)
        interactor.workerid = workerinput["workerid"]
        connect(interactor.channel.gateway, pipes)
        interactor.sendevent("workerready", workerinfo=xdist.remote.getinfodict())
        interactor.sendevent("collectionstart")
        interactor.pytest_collection_finish(session)


def connect(gateway: Any, pipes: list[int]) -> None:
    """Have execnet's gateway of a forked process read and write other pipes, in a thread of its own.

    Args:
        gateway: Of the process that was forked, whose channels have the numbers that the new ones have.
        pipes: What is read, and what is written.
    """
    before = gateway._io
    nowhere = os.open(os.devnull, os.O_RDWR)
    for each in (before.infile, before.outfile):
        os.dup2(nowhere, each.fileno(), inheritable=False)
    os.close(nowhere)
    for pipe in pipes:
        os.set_inheritable(pipe, False)
    gateway._io_before = before  # kept, for the thread that reads it, which is not here, has it locked
    gateway._io = Popen2IO(os.fdopen(pipes[1], "wb"), os.fdopen(pipes[0], "rb"), gateway.execmodel)
    gateway._receivepool = WorkerPool(gateway.execmodel)
    gateway._initreceive()
