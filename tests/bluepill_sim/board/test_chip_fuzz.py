"""Anything written anywhere: no crash, no hang, and the same in other slices, from snapshots, and on both cores.

P2OS_FUZZ_SECONDS sets how long each of the long tests goes on, P2OS_FUZZ_SEED where its seeds begin.
"""

import os
import signal
import time
from collections.abc import Iterator

import pytest

pytest.importorskip("unicorn")

from tests.bluepill_sim.board.hostile import Story
from tests.bluepill_sim.conftest import WALL_CLOCK_S

pytestmark = pytest.mark.usefixtures("watchdog")
#: What drives a robot.
MOTION = ("TIM1", "TIM2", "TIM3", "TIM4", "ADC1", "ADC2", "DMA1")


def stories(default_s: float, share: int, names: tuple[str, ...] | None) -> Iterator[Story]:
    """Make stories until the time is up; each of the two cores of a machine has seeds of its own."""
    end = time.monotonic() + float(os.environ.get("P2OS_FUZZ_SECONDS", str(default_s)))
    seed = int(os.environ.get("P2OS_FUZZ_SEED", "1000")) + share
    while time.monotonic() < end:
        yield Story(seed, names=names)
        seed += 2


def check(story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "native")
    whole = story.play()
    assert story.play(cuts=1 + story.seed) == whole, f"seed {story.seed}: other slices"
    assert story.play(forks=1 + story.seed) == whole, f"seed {story.seed}: from snapshots"
    if story.seed % 4 == 0:
        monkeypatch.setenv("P2OS_CORE", "python")
        assert story.play() == whole, f"seed {story.seed}: on the Python core"


@pytest.mark.parametrize("names", [None, MOTION], ids=["all", "motion"])
@pytest.mark.parametrize("seed", [0, 1])
def test_random_writes_end_alike_however_time_is_cut(
    monkeypatch: pytest.MonkeyPatch, seed: int, names: tuple[str, ...] | None
) -> None:
    check(Story(seed, 3, names), monkeypatch)


@pytest.mark.soak
@pytest.mark.parametrize("share", range(2))
@pytest.mark.parametrize(("names", "default_s"), [(None, 3600), (MOTION, 1800)], ids=["all", "motion"])
def test_an_hour_of_random_writes_ends_alike_however_time_is_cut(
    monkeypatch: pytest.MonkeyPatch, share: int, names: tuple[str, ...] | None, default_s: int
) -> None:
    for story in stories(default_s, share, names):
        signal.alarm(WALL_CLOCK_S)  # each story has the time of a test
        check(story, monkeypatch)
