"""Robots of one world are stepped together, each by its own set-points or by a hand."""

from dataclasses import dataclass, field

import pytest

from p2os.pioneer.body.contract import Wheels
from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose
from p2os.robots.parameters import load_parameters
from robot_bench.running.loop import RunLoop
from robot_bench.running.shared_world import SharedWorld
from simbase.timing import Nanos, Reached

NAMES, STARTS = ("one", "other"), (Pose(0.0, -1.0, 0.0), Pose(0.0, 1.0, 0.0))


class Leader:
    """A chip that does nothing but let time pass."""

    def __init__(self) -> None:
        self.now_ns = 0

    def advance_to(self, limit_ns: int) -> Reached:
        self.now_ns = limit_ns
        return Reached(limit_ns)


@dataclass
class Member:
    """A robot's run, what drives it and the hand at its wheels."""

    end: Nanos = 10**12
    loop: RunLoop = field(default_factory=lambda: RunLoop(Leader(), ()))
    rims: tuple[float, float] | None = None
    #: How many steps of its ramp it has asked for, and been notified of.
    asked: int = 0
    taken: list[Wheels] = field(default_factory=list)

    def next_setpoints(self) -> tuple[float, float]:
        self.asked += 1
        return self.asked / 1000, self.asked / 1000

    def take_step(self, wheels: Wheels) -> None:
        self.taken.append(wheels)

    def snapshot(self) -> object:
        return None

    def restore(self, snapshot: object) -> None: ...


@pytest.mark.parametrize("by_hand", NAMES)
def test_a_ramp_goes_on_as_ever_under_a_hand(by_hand: str) -> None:
    model = load_parameters("p2dx")
    scene = make_scene("kinematic", load_world("arena", seed=0), [model] * 2, STARTS, 0, trust=False)
    world, members = SharedWorld(scene, NAMES), {name: Member() for name in NAMES}
    for name, member in members.items():
        scene.bodies[NAMES.index(name)].is_powered = True
        world.join(name, member, member, member)
    held = members[by_hand]
    for steps in (10, 20, 30):
        held.rims = (0.1, 0.2) if steps == 20 else None
        world.run_to(steps * scene.dt_ns)
        assert {(member.asked, len(member.taken)) for member in members.values()} == {(steps, steps)}
    other = members[NAMES[1 - NAMES.index(by_hand)]]
    assert held.taken[:10] != held.taken[10:20]
    assert held.taken[:10] == other.taken[:10]
    assert held.taken[19] != other.taken[19]
