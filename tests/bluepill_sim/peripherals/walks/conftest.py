"""Every walk runs an emulator."""

import pytest


@pytest.fixture(autouse=True)
def watched(watchdog: None) -> None:
    """End a walk that hangs."""
