"""A place of its own on the network for each test."""

import os

import pytest

#: Domains whose ports lie below those that Linux gives to whoever asks for any.
FIRST, DOMAINS = 10, 80


@pytest.fixture
def domain() -> int:
    """A domain of this process; another run of the suite may have the same, so names are to differ too."""
    return FIRST + os.getpid() % DOMAINS


@pytest.fixture
def namespace() -> str:
    """What the names of this process's topics begin with."""
    return f"/t{os.getpid()}"
