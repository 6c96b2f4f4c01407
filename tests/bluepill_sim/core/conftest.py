"""No test of the core may hang the host."""

import pytest


@pytest.fixture(autouse=True)
def _limit(watchdog: None) -> None:
    """Use the watchdog in every test."""
