"""What comes of a fork that ends before, or in the middle of, what it has to send."""

import errno
import os
import signal
from multiprocessing.connection import Connection

import pytest

from robot_bench.running.forks import begin, how_it_ended, received
from simbase.user_classes import unforeseen


def sends(pipe: Connection, data: bytes) -> None:
    """Write to the pipe as a message is written, and be killed."""
    os.write(pipe.fileno(), data)
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("data", [b"", b"\0\0", b"\0\0\0\x64", b"\0\0\0\x64half"])
def test_a_fork_that_is_killed_while_it_sends_has_sent_nothing(data: bytes) -> None:
    process, pipe = begin(sends, data)
    assert received(process, pipe) is None
    assert how_it_ended(process) == "its process ended by SIGKILL"


def test_a_want_of_memory_is_no_bug() -> None:
    assert unforeseen(MemoryError()) == "there is not enough memory"
    assert unforeseen(MemoryError("no memory for a log")) == "no memory for a log"
    assert unforeseen(KeyError("x")) == "this is a bug: KeyError: 'x'"


def test_what_the_system_refuses_is_no_bug() -> None:
    """Found as a fork of `sensitivity` could open no more files where it looked for what is installed."""
    assert unforeseen(OSError(errno.EMFILE, "Too many open files", "x.txt")) == "cannot open x.txt: too many open files"
    assert unforeseen(OSError(errno.ENOSPC, "No space left")) == "cannot write standard output: no space left"
    assert unforeseen(OSError(errno.ENOTTY, "no")) == "this is a bug: OSError: [Errno 25] no"
