"""A robot that a program serves to itself: its options are those of `p2os serve`."""

import inspect
import threading
from pathlib import Path

import pytest

from p2os import Robot
from p2os.cli.virtual import serve
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.serve import served_pioneer
from p2os.protocol.profiles import Profile
from p2os.transport.virtual_clock import VirtualClock
from simbase.errors import P2osError

#: Options of the verb that are for a console or for several robots, and those that are called otherwise in Python.
OF_THE_VERB = {
    "context", "robots", "apart", "fleet", "control", "status_ns", "json_output", "trust", "view", "no_browser",
}  # fmt: skip
NAMES = {"port": "url", "fault": "faults", "worlds_folder": "worlds", "sync_limit_ns": "sync_limit_s"}


def test_every_option_of_serve_for_one_robot_is_a_word_of_served_pioneer() -> None:
    options = set(inspect.signature(serve.serve).parameters) - OF_THE_VERB
    assert {NAMES.get(name, name) for name in options} <= set(inspect.signature(served_pioneer).parameters)


@pytest.mark.parametrize(
    ("words", "family"),
    [
        ({"robot": "p3dx"}, Profile.AROS),
        ({"robot": "p3dx", "firmware": "arcos"}, Profile.ARCOS),
        ({"robot": "p3dx", "firmware": Profile.P2OS}, Profile.P2OS),
        ({"robot": "p3dx", "settings": ControllerSettings(profile=Profile.P2OS)}, Profile.P2OS),
        ({"for_client": "aria"}, Profile.ARCOS),
        ({"for_client": "aria", "firmware": "P2OS"}, Profile.P2OS),
    ],
    ids=str,
)
def test_it_speaks_what_its_model_speaks_or_what_it_is_told_to(words: dict[str, object], family: Profile) -> None:
    clock = VirtualClock()
    with served_pioneer(body="kinematic", clock=clock, **words) as url, Robot(url, clock=clock) as robot:  # type: ignore[arg-type]
        assert robot.profile is family


def test_its_thread_ends_with_it_and_keeps_no_program_from_ending() -> None:
    with served_pioneer(body="kinematic", clock=VirtualClock()):
        (thread,) = [one for one in threading.enumerate() if one.name == "p2os-pioneer"]
        assert thread.daemon
    thread.join(60)
    assert not thread.is_alive()


def test_what_describes_the_robot_reaches_it(tmp_path: Path) -> None:
    clock = VirtualClock()
    flash = tmp_path / "flash.toml"
    flash.write_text('[flash]\nname = "Wilma"\n', encoding="utf-8")
    with (
        served_pioneer(
            world="arena", seed=3, body="kinematic", rear_sonar=True, all_sonar=True, flash=flash, at=(0.5, 0.0, 1.5),
            faults=["sonar-stuck 3 1.2"], clock=clock,
        ) as url,
        Robot(url, clock=clock) as robot,
    ):  # fmt: skip
        assert robot.identity.name == "Wilma"
        echoes = {echo.number: echo for echo in robot.next_state().sonar}
        assert (len(echoes), echoes[2].range_m) == (16, pytest.approx(1.2, abs=0.01))
        (line,) = url.order("status")
    assert " 0.5" in line, line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"firmware": "AROSS"}, "no firmware 'AROSS'"),
        ({"settings": ControllerSettings(), "firmware": "AROS", "baud": 9600}, "settings beside firmware, baud"),
        ({"for_client": "nobody"}, "no settings for 'nobody'"),
        ({"faults": ["hiccup"]}, "hiccup"),
        ({"sync_limit_s": 0}, "must be more than 0"),
    ],
    ids=str,
)
def test_an_option_that_means_nothing_is_refused(words: dict[str, object], said: str) -> None:
    with pytest.raises(P2osError, match=said), served_pioneer(body="kinematic", **words):  # type: ignore[arg-type]
        raise AssertionError
