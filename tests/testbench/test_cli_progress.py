"""The progress line, and a Ctrl-C that waits for a good moment."""

import io
import os
import signal

import pytest
from rich.console import Console

from testbench.cli import progress
from testbench.cli.progress import RunDisplay
from testbench.cli.table import rows
from testbench.run import Progress

S = 10**9


def at(now_s: float) -> Progress:
    return Progress(now=round(now_s * S), duration_ns=120 * S, doing=lambda: "+187 / +187 mm/s  dodge: CRUISE")


def test_a_terminal_shows_time_speed_and_what_the_robot_does(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(progress, "Console", lambda **_: Console(file=shown, force_terminal=True, width=120))
    with RunDisplay(is_shown=True) as display:
        display.update(at(12.3))
        display.update(at(12.4))
    assert "12.3 of 120 s" in shown.getvalue()
    assert "dodge: CRUISE" in shown.getvalue()
    assert "×" in shown.getvalue()
    assert "12.4 of" not in shown.getvalue(), "no more than ten times a second"


def test_elsewhere_nothing_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with RunDisplay() as display:
        display.update(at(1))
    assert capsys.readouterr() == ("", "")


def test_ctrl_c_waits_for_the_next_update_and_the_old_handler_comes_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with RunDisplay(is_shown=False) as display:
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            display.update(at(1))
    assert signal.getsignal(signal.SIGINT) is before


def test_a_second_ctrl_c_does_not_wait() -> None:
    with RunDisplay(is_shown=False):
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)


def test_the_table_leaves_out_what_nobody_can_tell() -> None:
    outcome = dict.fromkeys(
        ("scenario", "world", "mode", "body", "seed", "virtual_s", "real_time_factor", "distance_m", "collisions",
         "min_clearance_m", "trace_sha256")
    )  # fmt: skip
    outcome |= {"virtual_s": 12.345, "collisions": 0}  # type: ignore[dict-item]
    assert dict(rows(outcome)) == {
        "scenario": "None in None, mode None, body None, seed None", "virtual time": "12.3 s", "collisions": "0",
    }  # fmt: skip
