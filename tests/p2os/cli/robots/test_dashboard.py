"""The dashboard as text: what stands where, and nothing that a state can hold breaks it."""

import io
import math
from dataclasses import replace

import pytest
from rich.console import Console

from p2os.cli.links.link_quality import LinkQuality, spread_of
from p2os.cli.robots.dashboard import Canvas, Dashboard, bar, draw
from p2os.client import Limits, Link, RobotPose, RobotState, SonarEcho
from p2os.protocol.connection import ConnectionStats
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS

LIMITS = Limits(1.5, 3.0, 0.3, 0.3, 1.0, 1.0)


def echo(number: int, angle_deg: float, range_m: float, *, is_echo: bool = True) -> SonarEcho:
    angle = math.radians(angle_deg)
    return SonarEcho(number, range_m, range_m * math.cos(angle), range_m * math.sin(angle), is_echo, 0)


STATE = RobotState(
    number=1, at_ns=0, pose=RobotPose(1.25, -0.5, math.pi / 2), forward_mps=0.75, turn_radps=-1.5, left_mps=0.8,
    right_mps=0.7, is_moving=True, motors_enabled=True, battery_v=11.2, stall_left=True, stall_right=False,
    front_bumpers=(2, 3), rear_bumpers=(), sonar=(echo(0, 90, 0.3), echo(3, 10, 1.0), echo(5, -40, 9, is_echo=False)),
    compass_rad=None, analog_port=5, analog_v=1.0, digital_in=0x81, digital_out=0, stop_button=True,
    state_of_charge=None, temperature_c=None, sip=StandardSip(),
)  # fmt: skip


def picture(dashboard: Dashboard, columns: int = 120) -> str:
    console = Console(width=columns, height=60, record=True, file=io.StringIO())
    console.print(draw(dashboard, columns))
    return console.export_text()


def dashboard(state: RobotState | None = STATE, link: Link = Link.OPEN) -> Dashboard:
    quality = LinkQuality(100 * NS_PER_MS)
    for at_ms in (0, 100, 200, 302, 602, 700):
        quality.packet(at_ms * NS_PER_MS)
    return Dashboard(
        title="Wilma", link=link, state=state, limits=LIMITS, parameters=load_parameters("p2dx"),
        stats=ConnectionStats(), quality=quality, news=("link lost: no packet",),
    )  # fmt: skip


def test_everything_has_its_place() -> None:
    text = picture(dashboard())
    for words in (
        "Wilma", "open", "1.250 m", "-0.500 m", "90.0 deg", "0.750 m/s", "11.2 V", "left", "front 2, front 3",
        "in 10000001", "pressed", "6 ", "2 missed", "nearest 0.30 m (sonar 0)", "link lost: no packet",
    ):  # fmt: skip
        assert words in text, words
    assert "─ sonar ─" in text


def test_a_narrow_terminal_gets_the_ring_and_one_line() -> None:
    text = picture(dashboard(), 80)
    assert "─ sonar ─" in text
    assert "─ motion ─" not in text
    assert max(len(line) for line in text.splitlines()) <= 80


def test_without_a_packet_it_says_so() -> None:
    assert "no packet yet" in picture(dashboard(None, Link.SEARCHING))


@pytest.mark.parametrize("motors", [None, True, False])
def test_no_state_breaks_it(motors: bool | None) -> None:
    bare = replace(STATE, sonar=(), battery_v=14.0, stall_left=False, front_bumpers=(), motors_enabled=motors,
                   stop_button=None, pose=RobotPose(1e6, -1e6, 1e4))  # fmt: skip
    assert "no echo" in picture(dashboard(bare))
    assert "no echo" in picture(dashboard(bare), 80)


def test_bars_grow_from_the_middle() -> None:
    assert bar(0.75, 1.5).plain == " " * 10 + "│█████     "
    assert bar(-3, 1.5).plain == "█" * 10 + "│" + " " * 10
    assert bar(1, 0).plain.strip() == "│"


def test_dots_become_braille_and_stay_inside() -> None:
    canvas = Canvas(2, 1)
    canvas.line(0, 0, 0, 3)
    canvas.dot(3, 3, "red")
    canvas.dot(-1, 0)
    canvas.dot(99, 99)
    assert canvas.lines() == [[("⡇", ""), ("⢀", "red")]]
    canvas.text(0, 0, "abc", "red")
    assert canvas.lines() == [[("ab", "red")]]
    assert (canvas.width, canvas.height) == (4, 4)


def test_the_spread_of_times() -> None:
    spread = spread_of([NS_PER_MS * time for time in (1, 2, 3, 4, 10)])
    assert spread is not None
    assert (spread.least_ms, spread.median_ms, spread.mean_ms, spread.p99_ms, spread.most_ms) == (1, 3, 4, 10, 10)
    assert spread.deviation_ms == pytest.approx(math.sqrt(10))
    assert spread_of([]) is None
    assert LinkQuality().spread is None
    assert LinkQuality().cycle_ns == 0


@pytest.mark.parametrize(("columns", "rows"), [(78, 24), (80, 24), (78, 16), (200, 24)])
def test_the_picture_fits_a_small_terminal(columns: int, rows: int) -> None:
    console = Console(width=columns, height=rows, record=True, file=io.StringIO())
    console.print(draw(dashboard(), columns, rows))
    lines = console.export_text().splitlines()
    assert len(lines) < rows
    assert max(map(len, lines)) <= columns
    text = "\n".join(lines)
    for words in ("Wilma", "x 1.250 m", "0.750 m/s", "11.2 V", "STALLED", "─ sonar ─", "nearest 0.30 m", "link lost"):
        assert words in text, words
