"""The progress line, and signals that wait for a good moment."""

import io
import signal

import pytest
from rich.console import Console

from robot_bench.cli import progress
from robot_bench.cli.progress import RunDisplay
from robot_bench.cli.table import rows
from robot_bench.run import RunProgress
from simbase.command_line.signals import end_on_signals, restored_signals

S = 10**9


def at(now_s: float) -> RunProgress:
    return RunProgress(now=round(now_s * S), duration_ns=120 * S, doing=lambda: "+187 / +187 mm/s  dodge: CRUISE")


def test_a_terminal_shows_time_speed_and_what_the_robot_does(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(progress, "ReadableConsole", lambda **_: Console(file=shown, force_terminal=True, width=120))
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_waits_for_the_next_update(number: int) -> None:
    with restored_signals():
        end_on_signals()
        with RunDisplay(is_shown=False) as display:
            signal.raise_signal(number)
            with pytest.raises(KeyboardInterrupt, match=signal.Signals(number).name):
                display.update(at(1))
            signal.raise_signal(number)
            display.update(at(2))


def test_the_table_leaves_out_what_nobody_can_tell() -> None:
    outcome = dict.fromkeys(
        ("scenario", "world", "mode", "body", "seed", "virtual_s", "real_time_factor", "distance_m", "collisions",
         "min_clearance_m", "trace_sha256")
    )  # fmt: skip
    outcome |= {"virtual_s": 12.345, "collisions": 0}  # type: ignore[dict-item]
    assert dict(rows(outcome)) == {
        "scenario": "None in None, mode None, body None, seed None", "virtual time": "12.3 s", "collisions": "0",
    }  # fmt: skip
