"""The ESP32's whole program behind FIFO and driver, and the model behind its receiver: same frames, same times.

A life is a robot driven by changing wires for some seconds: it connects, drives, falls silent now and then, is left.
Times are those at which a frame's last byte is out. The program counts microseconds and the model nanoseconds, so two
of them may lie a few microseconds apart, never a pass.
"""

from pathlib import Path
from random import Random

import pytest

from adapter_sim import AdapterSettings
from adapter_sim.receiver import Receiver
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from tests.adapter_fw.builds import built
from tests.adapter_fw.emulated import EmulatedEsp32
from tests.adapter_fw.shell import Shell
from tests.adapter_sim.conftest import CHARACTER_NS, MS, FakeRobot, Rig

#: The program looks at the mode jumper for so long before its adapter begins.
JUMPER_MS = 1
APART_US = 20
LIFE_MS = 6_000
#: The robot answers so much later than on a pass, so that no byte of it ends in one.
OFFSET_NS = 137_000


class LateRobot(FakeRobot):
    """A robot whose SIPs come at no whole millisecond."""

    def receive(self, data: bytes, now: int) -> None:
        before = self.next_sip
        super().receive(data, now)
        if self.next_sip is not None and self.next_sip != before:
            self.next_sip += OFFSET_NS


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("esp32-rev_b", tmp_path_factory.mktemp("esp32"))[0]


class Both:
    """Program and model with the same wires; the program's adapter begins in a millisecond of its time."""

    def __init__(self, program: Path | EmulatedEsp32, begins_ms: int = JUMPER_MS) -> None:
        self.shell = Shell(program, robot=LateRobot())
        self.rig = Rig(AdapterSettings(), LateRobot(), now=begins_ms * MS, receiver=Receiver())

    def run_ms(self, span_ms: int) -> None:
        self.shell.run_ms(span_ms)
        self.rig.run(self.shell.now_ms * MS)

    def connect(self, is_wanted: bool) -> None:
        self.shell.set("p2dx_con", is_wanted)
        self.rig.pins.set("p2dx_con", is_wanted, self.rig.now + 1)

    def drive(self, left: int, right: int) -> None:
        self.shell.drive(left & 7, right & 7)
        self.rig.pins.motors(left, right, self.rig.now + 1)

    def silence(self, is_silent: bool) -> None:
        self.shell.robot.sends = self.rig.robot.sends = not is_silent

    def live(self, seed: int) -> None:
        rng = Random(seed)
        self.run_ms(310)
        while self.shell.now_ms < LIFE_MS:
            what = rng.randrange(12)
            if what == 0:
                self.connect(is_wanted=False)
                self.run_ms(rng.randrange(5, 300))
            elif what == 1:
                self.silence(is_silent=True)
                self.run_ms(rng.choice([100, 349, 352, 500]))
                self.silence(is_silent=False)
            else:
                self.connect(is_wanted=True)
                self.drive(rng.randrange(-4, 4), rng.randrange(-4, 4))
                self.run_ms(rng.randrange(1, 400))

    def compare(self, apart_us: int = APART_US) -> int:
        """Return how many frames both have sent alike, none further apart than that."""
        free_at, model = 0, []
        for at, frame in self.rig.to_robot.log:
            free_at = max(free_at, at) + len(frame) * CHARACTER_NS
            model.append((free_at // 1_000, Command.from_frame(Frame.from_bytes(frame)).name))
        program = self.shell.commands
        count = min(len(program), len(model))
        assert [name for _, name in program[:count]] == [name for _, name in model[:count]]
        apart = [abs(one - other) for (one, _), (other, _) in zip(program[:count], model[:count], strict=True)]
        assert max(apart) <= apart_us
        assert abs(len(program) - len(model)) <= 4, "only what is still on the line"
        return count


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_program_and_model_send_the_same_frames_at_the_same_times(library: Path, seed: int) -> None:
    both = Both(library)
    both.live(seed)
    assert both.compare() > 20


@pytest.mark.soak
def test_program_and_model_are_the_same_over_a_hundred_lives(library: Path) -> None:
    assert sum(live_and_compare(library, seed) for seed in range(100)) > 5_000


def live_and_compare(library: Path, seed: int) -> int:
    both = Both(library)
    both.live(seed)
    return both.compare()
