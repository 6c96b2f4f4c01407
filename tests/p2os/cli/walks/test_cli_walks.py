"""What verbs print, what a dashboard draws, and what keys and link figures come to, as approved."""

import contextlib
import io
import os
import random
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

from rich.console import Console

from p2os.cli.links.link_quality import LinkQuality, spread_of
from p2os.cli.main import run
from p2os.cli.robots.dashboard import Dashboard, bar, line_of
from p2os.cli.robots.dashboard import draw as dashboard_of
from p2os.cli.robots.send import make_command, unknown_to
from p2os.cli.robots.teleop import Teleop, split_keys
from p2os.client import Link, RobotPose
from p2os.protocol.command_table import ROWS
from p2os.protocol.profiles import Profile
from simbase.timing import NS_PER_MS
from tests.p2os.cli.robots.test_dashboard import STATE, dashboard, echo
from tests.tools.suite.approved import Trace, judge_of, said, tried

GOLDEN = Path(__file__).resolve().parents[3] / "golden" / "captures"
VEL = "fafb060b3bc800d33b"
LINES = f"""\
decode --explain {VEL}
decode --explain fafb060b3bc800d33c
decode --json {VEL}
decode --robot p3dx GOLDEN/ros_p2dx.jsonl
decode --json GOLDEN/soar_p3dx.jsonl
decode nothing.pcap
export GOLDEN/arduino_p2dx.jsonl OUT/a.csv
export GOLDEN/soar_p3dx.jsonl -
export --only all GOLDEN/arduino_p2dx.jsonl -
export GOLDEN/soar_p3dx.jsonl OUT/a.csv
export GOLDEN/soar_p3dx.jsonl OUT/a.csv
export GOLDEN/soar_p3dx.jsonl OUT/a.odt
world list
world show room
world show office --seed 3
world show nowhere
world check walkway
world check ramp --up y
world new --kind maze --seed 4
world new --kind swamp
world new --kind slalom --out OUT/s.toml
world new --kind slalom --out OUT/s.toml
world new --kind slalom --seed 1 --out OUT/s.toml --force
world convert OUT/s.toml --out OUT/s.sdf
world convert OUT/s.toml --out OUT/s.xyz
world convert walkway --out OUT/r.urdf --robot p3at
world check OUT/s.sdf
world convert
send --list
send --list --json
send tcp:127.0.0.1:1 NOTHING
send tcp:127.0.0.1:1 VEL 99999
send tcp:127.0.0.1:1 VEL x
drive tcp:127.0.0.1:1
drive nowhere --forward 1
drive nowhere --forward 1m
drive nowhere --forward 9000m
drive nowhere --vel 1m/s
drive nowhere --for 2s
drive nowhere --vel 0.2m/s --for 2s --turn 90deg
serve --world nowhere
serve --robot p4
serve --baud 1
replay GOLDEN/none.jsonl nowhere
replay GOLDEN/aria_p2de.jsonl nowhere --as client
replay GOLDEN/aria_p2de.jsonl nowhere --speed 0
sniff nowhere --listen nowhere
record nowhere --out OUT/a.csv
bench nowhere
teleop nowhere --vel 1
render GOLDEN/aria_p2de.jsonl --out OUT/x.odt
"""
#: Near, beyond it, twice as far, and at the rim of the ring, m.
FAR = (0.2, 0.34, 0.36, 0.5, 0.69, 0.71, 2.9, 3.1, 5.0)
KEYS = [*"wasdijl,uom.qx +-=_zZk", "up", "down", "left", "right", "escape", "W"]


def verbs(draw: random.Random) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as made, patch.dict(os.environ, COLUMNS="80"):
        for line in LINES.splitlines():
            words = [word.replace("GOLDEN", str(GOLDEN)).replace("OUT", made) for word in line.split()]
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
                code = run(words)
            said_now = f"{line}\n{code}\n{out.getvalue()}\n{err.getvalue()}"
            yield said_now.replace(str(GOLDEN), "GOLDEN").replace(made, "OUT")


def commands(draw: random.Random) -> Iterator[str]:
    for row in ROWS:
        for words in ([], ["1"], ["-5"], ["0x10"], ["1", "2"], ["ab"], ["400"]):
            yield tried(make_command, row.name, words)
        yield said(
            [
                tried(lambda row=row, profile=profile: unknown_to(make_command(row.name, ["1"]), profile))
                for profile in Profile
            ]
        )
    for name in ("vel", "11", "300", "-1", "nothing", "EN"):
        yield tried(make_command, name, ["1"])


def dashboards(draw: random.Random) -> Iterator[str]:
    for number in range(14):
        state = replace(
            STATE, pose=RobotPose(draw.uniform(-9, 9), 0.5, draw.uniform(-4, 4)), forward_mps=draw.uniform(-2, 2),
            turn_radps=draw.uniform(-4, 4), battery_v=draw.choice((9.0, 11.4, 11.5, 11.6, 12.1, 12.6, 14.0)),
            stall_left=draw.random() < 0.3, stall_right=draw.random() < 0.3, motors_enabled=draw.random() < 0.5,
            front_bumpers=tuple(draw.sample(range(6), 2)), rear_bumpers=draw.choice(((), (1,))),
            sonar=tuple(
                echo(n, draw.uniform(-180, 180), draw.choice(FAR), is_echo=draw.random() < 0.7) for n in range(8)
            ),
            compass_rad=draw.choice((None, 1.0)), state_of_charge=draw.choice((None, 40)),
            temperature_c=draw.choice((None, 31)), stop_button=draw.random() < 0.3,
        )  # fmt: skip
        shown: Dashboard = dashboard(None if number == 5 else state, draw.choice(list(Link)))
        for columns, rows in ((120, 40), (80, 24), (50, 12)):
            console = Console(
                width=columns, height=60, record=True, file=io.StringIO(), color_system="standard", force_terminal=True
            )
            console.print(dashboard_of(shown, columns, rows))
            yield console.export_text(styles=True)
        yield line_of(state)
        yield str(bar(state.forward_mps, 1.5))


def keys(draw: random.Random) -> Iterator[str]:
    teleop, now = Teleop(0.3, 0.8), 0
    for number in range(200):
        now += draw.choice((0, 10, 60, 200, 900)) * NS_PER_MS
        if number % 25 == 24:
            teleop.stop(now)
        elif number % 7 == 6:
            teleop.advance_to(now)
        else:
            teleop.press(draw.choice(KEYS), now)
        yield said(
            (
                now,
                teleop.speeds,
                teleop.share,
                teleop.is_over,
                teleop.is_driving,
                teleop.is_stopped,
                teleop.next_deadline(),
            )
        )
    for text in ("wW\x1b[A\x1b[D\x1bOB", "\x1b", "\x1b[1;5Cq", "\x1b[", "\x1b[3~x", "+\x1b\x1b[C", "\x1bx"):
        yield said(split_keys(text))


def links(draw: random.Random) -> Iterator[str]:
    for cycle in (None, 100 * NS_PER_MS):
        quality, at = LinkQuality(cycle), 0
        for _ in range(40):
            at += draw.choice((95, 100, 105, 149, 151, 300, 1000)) * NS_PER_MS
            quality.packet(at)
            yield said((quality.packets, quality.missed, quality.cycle_ns, quality.spread))
    yield said([spread_of([NS_PER_MS * draw.randrange(99) for _ in range(count)]) for count in (0, 1, 2, 99, 100, 101)])


TRACES: dict[str, Trace] = {each.__name__: each for each in (verbs, commands, dashboards, keys, links)}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
