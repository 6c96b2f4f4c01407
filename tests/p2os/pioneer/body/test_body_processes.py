"""A body gives the same bits in every process, and PyBullet comes in silence or with a hint."""

import gc
import hashlib
import os
import pickle
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest

from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import engines, make_body, make_scene
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Obstacle
from p2os.robots.parameters import load_parameters
from simbase.installation import install_command
from tests.p2os.pioneer.body.bodies import ENGINES, drive

P2DX = load_parameters("p2dx")
#: Restores each body's snapshot in a process of its own and prints the digests of what follows.
FOLLOW = """
import importlib.util, pathlib, pickle, sys
test, folder, *names = sys.argv[1:]
spec = importlib.util.spec_from_file_location("follow", test)
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
for name in names:
    body = module.make_body(name, module.load_world("arena", 3), module.P2DX)
    body.restore(pickle.loads((pathlib.Path(folder) / name).read_bytes()))
    print(module.digest_of_the_rest(body))
"""

#: Asks for bodies each where a module cannot be imported, and prints what is said.
MISSING = """
import sys
from simbase.errors import MissingDependencyError
from p2os.robots.parameters import load_parameters
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
for case in sys.argv[1:]:
    body, missing = case.split(":")
    sys.modules[missing] = None
    try:
        make_body(body, load_world("room"), load_parameters("p2dx"))
    except MissingDependencyError as error:
        print(error, error.hint)
    del sys.modules[missing]
"""

#: Makes a body between two words of its own, and prints nothing else.
SPEAKS = """
import sys
sys.stdout.write("before ")
from p2os.pioneer.body.factory import make_body
from p2os.robots.parameters import load_parameters
from p2os.pioneer.world import load_world
make_body("bullet", load_world("room"), load_parameters("p2dx"))
sys.stdout.write("after")
sys.stderr.write("heard")
"""


def digest_of_the_rest(body: RobotBody) -> str:
    """Drive on for 0.6 s, into a post and back, and hash all that is seen."""
    seen = []
    for number in range(600):
        body.step(0.4 if number < 400 else -0.2, 0.38 if number < 400 else -0.3)
        if number % 20 == 0:
            seen.append((body.state, body.ranges([2, 3, 4]), body.clearance()))
    return hashlib.sha256(repr(seen).encode()).hexdigest()


def run(*arguments: str, seed: str = "0") -> subprocess.CompletedProcess[str]:
    environment = {
        **os.environ,
        "PYTHONHASHSEED": seed,
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
    }
    return subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, timeout=60, check=True
    )


@pytest.mark.slow
def test_snapshots_of_all_bodies_go_on_alike_in_other_processes(tmp_path: Path) -> None:
    names = [name for name in engines() if name not in ENGINES or find_spec(ENGINES[name])]
    here = []
    for name in names:
        body = make_body(name, load_world("arena", 3), P2DX)
        body.place(Obstacle(name="post", x_m=0.5, y_m=0.0, radius_m=0.05))
        body.remove("thing 2")
        drive(body, 0.35, 0.35, 0.9)
        (tmp_path / name).write_bytes(pickle.dumps(body.snapshot()))
        here.append(digest_of_the_rest(body))
        assert body.state.collisions >= 1
    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    assert run("-c", FOLLOW, __file__, str(tmp_path), *names, seed=seed).stdout.split() == here


@pytest.mark.bullet
def test_the_engine_comes_without_its_banner() -> None:
    pytest.importorskip("pybullet")
    done = run("-c", SPEAKS, seed="0")
    assert (done.stdout, done.stderr) == ("before after", "heard")


@pytest.mark.bullet
def test_the_engine_comes_where_standard_error_is_closed() -> None:
    pytest.importorskip("pybullet")
    assert run("-c", "import os; os.close(2); import p2os.pioneer.body.bullet; print('there')").stdout == "there\n"


def test_a_missing_engine_is_named_with_the_way_to_get_it() -> None:
    cases = [("bullet", "pybullet"), ("mujoco", "mujoco")]
    cases += [(body, "numpy") for body, package in ENGINES.items() if find_spec(package)]
    reported = run("-c", MISSING, *[":".join(case) for case in cases]).stdout.splitlines()
    for (body, missing), line in zip(cases, reported, strict=True):
        assert f"the {body} body needs {missing}" in line
        assert f"{install_command(body)}, or --body" in line


def test_a_blocked_robot_goes_on_when_the_thing_is_taken_away() -> None:
    body = make_body("kinematic", load_world("room"), P2DX)
    body.place(Obstacle(name="post", x_m=0.3, y_m=0.0, radius_m=0.1))
    for _ in range(300):
        body.step(0.2, 0.2)
    stuck = body.state
    body.step(0.2, 0.2)
    assert stuck.stalled_left
    assert body.state == stuck
    body.remove("post")
    body.step(0.2, 0.2)
    assert body.state.x_m > stuck.x_m
    assert not body.state.stalled_left


@pytest.mark.bullet
def test_a_client_that_other_robots_had_is_as_good_as_a_new_one(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = pytest.importorskip("p2os.pioneer.body.bullet.engine")
    gc.collect()  # no scene that is left over gives its client back meanwhile
    clients = engine.Clients()
    monkeypatch.setattr("p2os.pioneer.body.bullet.body.clients", clients)
    first = make_body("bullet", load_world("arena", 3), P2DX)
    there = digest_of_the_rest(first)
    client = first.scene.client
    clients.give_back(client)
    others = make_scene("bullet", load_world("office"), [P2DX, P2DX])
    assert others.client == client
    for _ in range(300):
        others.step([(0.3, 0.3), (-0.2, 0.2)])
    clients.give_back(client)
    again = make_body("bullet", load_world("arena", 3), P2DX)
    assert again.scene.client == client
    assert digest_of_the_rest(again) == there
    first.scene.client = others.client = -1  # one of them gives it back


@pytest.mark.slow
@pytest.mark.bullet
def test_scenes_that_nobody_uses_any_more_leave_their_clients_to_new_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = pytest.importorskip("p2os.pioneer.body.bullet.engine")
    gc.collect()  # as above
    monkeypatch.setattr("p2os.pioneer.body.bullet.body.clients", engine.Clients())
    opened, connect = list[int](), engine.pybullet.connect

    def open_one(how: int) -> int:
        opened.append(connect(how))
        return opened[-1]

    monkeypatch.setattr(engine.pybullet, "connect", open_one)
    room = load_world("room")
    for _ in range(4):
        make_body("bullet", room, P2DX)
    assert len(opened) == engine.MOST_IDLE
    held = [make_body("bullet", room, P2DX) for _ in range(3)]
    assert len(opened) == len({body.scene.client for body in held}) == 3  # type: ignore[attr-defined]  # a BulletBody
    looked = list[tuple[int, int]]()
    monkeypatch.setattr(
        engine, "gc", SimpleNamespace(collect=lambda generation: looked.append((len(opened), generation)))
    )
    held += [make_body("bullet", room, P2DX) for _ in range(2)]
    assert looked == [(4, 1), (4, 2)], "where all are in use, that is seen to again when there are twice as many"
    held.clear()
    gc.collect()  # they go back to where they were taken from
