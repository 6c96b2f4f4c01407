"""Driving by game pad: the connect request, the loss, the speeds; and a pad that SDL makes up."""

import ctypes
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.cli.main import run
from p2os.cli.robots import pad_source, teleop
from p2os.cli.robots.pad_source import SdlPad
from p2os.cli.robots.page_stop import PageStop
from p2os.cli.robots.teleop import PAD_PERIOD_NS, PadDriver
from p2os.client import GapStopped, Notice
from p2os.client.notices import LinkLostError
from p2os.gamepad import PAD_MPS, PAD_RADPS, Gamepad, PadReport
from p2os.view.run_control import RunCommand
from simbase.errors import MissingDependencyError, UsageError
from simbase.timing import NS_PER_MS

UP, NOTHING, DOWN = PadReport(up=True), PadReport(), PadReport(down=True)


class Bench:
    """A pad that follows a script, a clock, and a robot that notes what it is told."""

    def __init__(
        self, reports: list[PadReport | None], *, link_fails_at: int = -1, stop: PageStop | None = None
    ) -> None:
        self.reports = iter(reports)
        self.now = 0
        self.reported: list[tuple[int, float, float]] = []
        self.lines: list[str] = []
        self.entered = self.left = 0
        self.link_fails_at = link_fails_at
        PadDriver(
            lambda: next(self.reports, None),
            lambda: self,
            (PAD_MPS, PAD_RADPS),
            clock=lambda: self.now,
            wait=self.wait,
            report=self.lines.append,
            stop=stop,
        ).run()

    def wait(self, span_ns: int) -> None:
        self.now += span_ns

    def __enter__(self) -> Self:
        self.entered += 1
        return self

    def __exit__(self, *_: object) -> None:
        self.left += 1

    def on_event(self, callback: Callable[[Notice], None]) -> None:
        self.tell = callback

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        if len(self.reported) == self.link_fails_at:
            self.reported.append((self.now, 0, 0))
            raise LinkLostError("silence")
        self.reported.append((self.now, forward_mps, turn_radps))


def test_up_connects_the_sticks_drive_and_down_lets_go() -> None:
    drive = PadReport(forward=1023, turn=511)
    bench = Bench([NOTHING, UP, drive, PadReport(backward=1023), PadReport(turn=-511), DOWN])
    assert (bench.entered, bench.left) == (1, 1)
    speeds = [(forward, turn) for _, forward, turn in bench.reported]
    assert speeds == [(PAD_MPS, -PAD_RADPS), (-PAD_MPS, 0), (0, PAD_RADPS), (0, 0)]
    assert bench.lines[-2:] == ["Down was pressed: the robot stands; Up connects again", "the pad is gone"]


def test_a_button_that_is_down_at_the_start_means_nothing() -> None:
    assert Bench([UP, UP, NOTHING]).entered == 0


def test_a_pad_that_goes_stops_the_robot_in_200_ms_and_up_must_be_given_anew() -> None:
    drive = PadReport(forward=1023)
    bench = Bench([NOTHING, UP, drive, *[None] * 9, PadReport(up=True, forward=1023), drive, drive])
    assert (bench.entered, bench.left) == (1, 1)
    lost_at = next(at for at, forward, _ in bench.reported if forward == 0)
    assert lost_at - 2 * PAD_PERIOD_NS <= 200 * NS_PER_MS
    assert "the pad is lost: the robot stands; Up connects again" in bench.lines


class PausedBench(Bench):
    """The fourth wait takes half a second."""

    waits = 0

    def wait(self, span_ns: int) -> None:
        self.waits += 1
        self.now += 500 * NS_PER_MS if self.waits == 4 else span_ns


def test_after_a_pause_up_must_be_given_anew() -> None:
    drive = PadReport(forward=1023)
    bench = PausedBench([NOTHING, UP, drive, drive, drive, drive])
    assert (bench.entered, bench.left) == (1, 1)
    assert [forward for _, forward, _ in bench.reported] == [PAD_MPS, PAD_MPS, 0]
    assert "paused for 0.5 s: the robot stands; Up connects again" in bench.lines


class StoppedBench(Bench):
    """The client stops the robot by itself."""

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        super().set_velocity(forward_mps, turn_radps)
        if len(self.reported) == 2:
            self.tell(GapStopped(NS_PER_MS))


def test_after_a_stop_of_the_client_up_must_be_given_anew() -> None:
    bench = StoppedBench([NOTHING, UP, *[PadReport(forward=1023)] * 4])
    assert bench.left == 1
    assert [forward for _, forward, _ in bench.reported] == [PAD_MPS, PAD_MPS, 0]
    assert "the client stopped the robot: the robot stands; Up connects again" in bench.lines


def test_stop_on_the_page_ends_the_session_and_up_must_be_given_anew() -> None:
    stop = PageStop()
    stop.offer(RunCommand(do="stop"))  # of a session before

    class StoppedFromPage(Bench):
        def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
            super().set_velocity(forward_mps, turn_radps)
            if len(self.reported) == 2:
                stop.offer(RunCommand(do="stop"))

    bench = StoppedFromPage([NOTHING, UP, *[PadReport(forward=1023)] * 4], stop=stop)
    assert bench.left == 1
    assert [forward for _, forward, _ in bench.reported] == [PAD_MPS, PAD_MPS, 0]
    assert "STOP was pressed on the page: the robot stands; Up connects again" in bench.lines


def test_a_lost_link_ends_the_session() -> None:
    bench = Bench([NOTHING, UP, PadReport(forward=500), PadReport(forward=500)], link_fails_at=1)
    assert bench.left == 1
    assert "the link is lost: the robot stands; Up connects again" in bench.lines


@given(forward=st.integers(0, 1023), backward=st.integers(0, 1023), turn=st.integers(-512, 511))
def test_no_report_asks_for_more_than_full_speed(forward: int, backward: int, turn: int) -> None:
    pad = Gamepad()
    pad.take(PadReport(forward=forward, backward=backward, turn=turn), 0)
    assert abs(pad.forward) <= 1023
    assert abs(pad.turn) <= 511


# SDL ------------------------------------------------------------------------------------


@pytest.fixture
def virtual(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, int, int], None]]:
    """Attach SDL's virtual game pad; set("axis", number, value) or set("button", number, value) moves it."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    pygame = pytest.importorskip("pygame", reason="pygame-ce is not installed")
    found = list((Path(pygame.__file__).parents[1] / "pygame_ce.libs").glob("libSDL2-2*"))
    if not found:
        pytest.skip("this pygame-ce comes without its own SDL 2")
    sdl = ctypes.CDLL(str(found[0]))
    pygame.display.init()
    pygame.joystick.init()
    number = sdl.SDL_JoystickAttachVirtual(1, 6, 15, 1)  # a game controller
    assert number >= 0
    sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p

    def move(kind: str, place: int, value: int) -> None:
        handle = ctypes.c_void_p(sdl.SDL_JoystickFromInstanceID(pygame.joystick.Joystick(number).get_instance_id()))
        if kind == "gone":
            sdl.SDL_JoystickDetachVirtual(number)
        elif kind == "axis":
            sdl.SDL_JoystickSetVirtualAxis(handle, place, ctypes.c_int16(value))
        else:
            sdl.SDL_JoystickSetVirtualButton(handle, place, ctypes.c_uint8(value))

    yield move
    if pygame.joystick.get_init():
        sdl.SDL_JoystickDetachVirtual(number)
        pygame.joystick.quit()
    pygame.display.quit()


def test_a_pad_of_sdl_is_read(virtual: Callable[[str, int, int], None]) -> None:
    with SdlPad() as pad:
        assert pad.name
        for axis, value in ((4, -32768), (5, -32768), (2, 0)):
            virtual("axis", axis, value)
        assert pad.report() == NOTHING
        virtual("button", 11, 1)
        assert pad.report() == UP
        virtual("button", 11, 0)
        virtual("button", 12, 1)
        assert pad.report() == DOWN
        virtual("button", 12, 0)
        virtual("axis", 5, 32767)
        virtual("axis", 2, -32768)
        report = pad.report()
        assert report is not None
        assert (report.forward, report.backward, report.turn) == (1023, 0, -511)
        virtual("gone", 0, 0)
        assert pad.report() is None


def test_without_a_pad_or_a_library_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame", reason="pygame-ce is not installed")
    with pytest.raises(UsageError, match="no game pad is known here"):
        SdlPad()
    monkeypatch.setitem(__import__("sys").modules, "pygame", None)
    with pytest.raises(MissingDependencyError, match="a game pad needs pygame-ce"):
        SdlPad()


def test_the_verb_drives_by_pad(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    class Scripted:
        name = "a pad"
        scripts = iter([NOTHING, UP, DOWN])

        def __enter__(self) -> Self:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def report(self) -> PadReport | None:
            return next(self.scripts, None)

    from p2os.pioneer.serve import served_pioneer

    monkeypatch.setattr(teleop, "SdlPad", Scripted)
    with served_pioneer(body="kinematic") as url:
        assert run(["teleop", url, "--pad"]) == 0
    assert "connected: R2 ahead" in capsys.readouterr().err
    assert pad_source.SdlPad is SdlPad
    assert os.environ.get("SDL_VIDEODRIVER", "dummy") == "dummy"
