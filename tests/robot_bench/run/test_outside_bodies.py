"""A bench whose body is another program: the same trace each time, and a complete folder when that program is lost."""

import json
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO

import pytest

from p2os.cli.main import run as p2os
from p2os.pioneer.body.outside.body import Ability
from p2os.pioneer.body.outside.messages import Hello, encode_request
from p2os.pioneer.world.model import Obstacle
from robot_bench import Bench
from simbase.errors import UsageError
from simbase.listening import OPENINGS
from tests.p2os.pioneer.body.outside.served import Served, served, serving
from tests.robot_bench.firmware.hurried import hurried, hurried_scenario
from tests.tools.made_once import made_once

SOURCE = Path(__file__).parents[3] / "examples" / "outside_body"
needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed: apt-get install g++")


@contextmanager
def started(*command: str | Path, errors: IO[bytes] | None = None) -> Iterator[str]:
    """Run a program that is a body until the end of the block; yield where it says that it listens."""
    words = [str(word) for word in command]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True) as program:
        try:
            assert program.stdout is not None
            yield next(line for line in program.stdout if line.startswith("listening on ")).split()[-1]
        finally:
            program.kill()


@pytest.fixture(scope="module")
def plan_view(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def build(folder: Path) -> Path:
        program = folder / "plan_view"
        flags = ("-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror", "-fsanitize=undefined", "-fno-sanitize-recover")
        subprocess.run(["g++", *flags, "-o", program, SOURCE / "plan_view.cpp"], check=True, timeout=100)
        return program

    return made_once(tmp_path_factory, "plan-view", build)


def bench_with(body: str, mode: str = "adapter", seconds: float = 3.4) -> Bench:
    return Bench.from_scenario(hurried_scenario("dodge", body=body, mode=mode, duration_s=seconds))


def hash_of(bench: Bench, until: str = "3.4 s") -> str:
    bench.run_until(until)
    return bench.trace.sha256


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("mode", ["adapter", "direct"])
def test_a_body_in_c_gives_the_same_trace_twice_and_from_a_fork(plan_view: Path, mode: str) -> None:
    with started(plan_view, "tcp:127.0.0.1:0") as address:
        first = bench_with(address, mode)
        first.run_until("1 s")
        fork = first.fork()
        hashes = {hash_of(bench) for bench in (first, fork, bench_with(address, mode))}
        first.rewind("2 s")
        hashes.add(hash_of(first))
        assert len(hashes) == 1
        assert first.pose.x_m > 0.3


@needs_compiler
@pytest.mark.slow
def test_a_body_in_c_has_walls_of_its_own(plan_view: Path) -> None:
    with started(plan_view, "tcp:127.0.0.1:0", "--wall", "0.4,-1,0.4,1") as address:
        bench = Bench.from_scenario("motors", body=address, firmware=hurried("motors"), duration_s=3.2)
        bench.run_until("3.2 s")
        assert bench.parts.body.state.collisions >= 1
        assert bench.pose.x_m < 0.4
        assert "own wall" in bench.trace.text


def refuses_pages(folder: Path, *command: str | Path) -> None:
    """Have a body meet what a browser begins with, split at every byte, and then a client of its own."""
    hello = encode_request(GREETING)
    log = folder / "errors"
    with log.open("wb") as errors, started(*command, "tcp:127.0.0.1:0", errors=errors) as address:
        there = ("127.0.0.1", int(address.rpartition(":")[2]))
        requests = [opening + b"/ HTTP/1.1\r\nHost: a\r\n\r\n" + hello for opening in OPENINGS]
        for request, place in ((request, place) for request in requests for place in range(1, 9)):
            with socket.create_connection(there, timeout=30) as page:
                page.sendall(request[:place])
                with suppress(ConnectionError):
                    page.sendall(request[place:])
                    assert page.recv(1) == b""
        with socket.create_connection(there, timeout=30) as client:
            client.sendall(hello)
            assert client.recv(5)[4:] == b"\x81", "Welcome"
    assert log.read_text() == "connection refused: it begins with no Hello\n" * 8 * len(requests)


GREETING = Hello(
    1, 1_000_000, "p2dx", (0.3, 0.19, 0.05, 0.24, 9.0, 0.5, 1.0, 0.2, 5.0, 0.0, 0.5), ((0.2, 0.1), (-0.2, -0.1)), ()
)
#: A body that can do nothing but greet.
GREETER = """
import sys
sys.path.insert(0, {folder!r})
from lock_step import main, welcome

class Body:
    def hello(self, fields):
        return welcome(0, "greeter", "")

main(Body)
"""


def test_a_body_in_python_refuses_web_pages(tmp_path: Path) -> None:
    program = tmp_path / "greeter.py"
    program.write_text(GREETER.format(folder=str(SOURCE)))
    refuses_pages(tmp_path, sys.executable, program)


@needs_compiler
@pytest.mark.slow
def test_a_body_in_c_refuses_web_pages(plan_view: Path, tmp_path: Path) -> None:
    refuses_pages(tmp_path, plan_view)


def same_trace_twice(name: str, *command: str | Path, saves: bool) -> None:
    """Have a body on an engine drive two benches alike, one of them forked where it saves, and push a cart."""
    with started(*command, "tcp:127.0.0.1:0") as address:
        first, other = bench_with(address), bench_with(address)
        first.run_until("1 s")
        if saves:
            assert hash_of(first.fork()) == hash_of(other)
        else:
            with pytest.raises(UsageError, match=rf"the outside body {name} at tcp:.* cannot save its state"):
                first.fork()
        assert hash_of(first) == hash_of(other)
        assert 0.3 < first.pose.x_m < 2.5
        body = first.parts.body
        body.place(Obstacle(name="cart", x_m=body.state.x_m + 0.5, y_m=0.0, length_m=0.2, width_m=0.6, mass_kg=1.0))
        for _ in range(2500):
            body.step(0.3, 0.3)
        assert [hit.name for hit in body.take_hits()] == ["cart"]
        assert [thing.name for thing in body.take_moved()] == ["cart"]
        assert body.clearance() < 0.05


@pytest.mark.slow
@pytest.mark.bullet
@pytest.mark.parametrize(
    ("engine", "file", "name"), [("pybullet", "bullet_body.py", "PyBullet"), ("pydrake", "drake_body.py", "Drake")]
)
def test_a_body_on_a_physics_engine_in_another_process_gives_the_same_trace_twice(
    engine: str, file: str, name: str
) -> None:
    if find_spec(engine) is None:
        pytest.skip(f"{engine} is not installed")
    same_trace_twice(name, sys.executable, SOURCE / file, saves=engine == "pydrake")


@needs_compiler
@pytest.mark.soak  # DART's headers take most of a minute
@pytest.mark.parametrize(
    ("library", "file", "name"), [("dart", "dart_body", "DART"), ("gz-sim8", "gazebo_body", "Gazebo")]
)
def test_a_body_on_an_engine_in_c_gives_the_same_trace_twice(
    library: str, file: str, name: str, tmp_path: Path
) -> None:
    found = subprocess.run(["pkg-config", "--cflags", "--libs", library], capture_output=True, text=True, check=False)
    if found.returncode != 0:
        pytest.skip(f"pkg-config knows no {library}: apt-get install lib{library}-dev")
    source, program = SOURCE / f"{file}.cpp", tmp_path / file
    words = ["g++", "-O1", "-Wall", "-o", program, source, *found.stdout.split(), "-std=c++17"]
    subprocess.run(words, check=True, timeout=300)
    same_trace_twice(name, program, saves=name == "DART")


@pytest.mark.parametrize("mode", ["adapter", "direct"])
def test_a_bench_with_a_body_behind_the_protocol_sees_what_one_with_the_body_sees(mode: str) -> None:
    with served() as (address, servers):
        ours, theirs = (bench_with(body, mode, 2) for body in ("kinematic", address))
        poses = []
        for bench in (ours, theirs):
            bench.run_until("2 s")
            poses.append([line for line in bench.trace.text.splitlines()[1:] if '"k":"pose"' in line])
        assert poses[0] == poses[1] != []
        asked = servers[0].steps_asked
        assert sum(asked) <= 2000
        assert max(asked) > 1


def dies(after: int) -> Callable[[], Callable[..., bytes | None]]:
    def make() -> Callable[..., bytes | None]:
        honest, left = Served("kinematic", Ability(7)), [after]

        def answer(request: object) -> bytes | None:
            left[0] -= 1
            return honest(request) if left[0] > 0 else None

        return answer

    return make


@pytest.mark.parametrize("after", [1, 3, 100])
def test_a_run_whose_body_is_lost_ends_in_one_line_with_a_complete_folder(
    after: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with serving(dies(after)) as address:
        options = ["--mode", "direct", "--body", address, "--duration", "1s"]
        assert p2os(["run", "motors", *options, "--out", str(tmp_path / "r")]) == 1
    err = capsys.readouterr().err
    assert err.count("is lost: it has closed the line") == 1
    assert "Traceback" not in err
    summary = json.loads((tmp_path / "r" / "summary.json").read_text(encoding="utf-8"))
    assert "is lost" in summary["failures"][0]
    assert (tmp_path / "r" / "report.html").is_file()


def test_a_body_that_cannot_save_is_run_but_not_forked_or_wound_back() -> None:
    with served(abilities=Ability.ROLLS) as (address, _):
        bench = bench_with(address, "direct", 1)
        bench.run_until("0.2 s")
        for call in (bench.fork, bench.snapshot, lambda: bench.rewind("0.1 s")):
            with pytest.raises(UsageError, match="cannot save its state"):
                call()
        bench.run_until("0.3 s")
