"""The real image of the firmware, in an emulator of the ESP32, and the model: same frames, same times.

Both are brought by whoever runs this; without them it is skipped, and says what is missing. A life is one of
test_program_as_model.py. The image's adapter begins between two of the system's ticks, and looks at its wires on ticks:
from the second pass on, as the model that begins with it.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import load_world
from tests.adapter_fw.emulated import NS_PER_US, EmulatedEsp32, named
from tests.adapter_fw.shell import Shell
from tests.adapter_fw.test_program_as_model import Both
from tests.adapter_sim.conftest import PARAMETERS

#: What the chip needs for a pass: interrupts, the task, the driver.
MOST_US = 200
#: Of the second pass.
BEGINS_MS = 2


@contextmanager
def chip() -> Iterator[EmulatedEsp32]:
    """Give the chip power while the block runs."""
    names = named()
    if isinstance(names, str):
        pytest.skip(names)
    esp32 = EmulatedEsp32(*names)
    try:
        yield esp32
        assert esp32.lost == 0
    finally:
        esp32.close()


def live(seed: int) -> int:
    """Live a life in image and model; return how many frames both have sent."""
    with chip() as esp32:
        both = Both(esp32, BEGINS_MS)
        both.run_ms(1)
        both.live(seed)
        return both.compare(MOST_US)


@pytest.mark.slow
def test_the_image_and_the_model_send_the_same_frames_at_the_same_times() -> None:
    assert live(0) > 20


@pytest.mark.soak
@pytest.mark.parametrize("seeds", [range(first, first + 10) for first in range(0, 100, 10)], ids=str)
def test_the_image_and_the_model_are_the_same_over_a_hundred_lives(seeds: range) -> None:
    assert sum(map(live, seeds)) > 500


@pytest.mark.slow
def test_the_image_drives_a_virtual_pioneer_and_leaves_it_standing() -> None:
    with chip() as esp32:
        robot = Pioneer(parameters=PARAMETERS, body=make_body("kinematic", load_world("room"), PARAMETERS))
        shell = Shell(esp32, robot=robot)
        shell.connect()
        began_at = robot.body.state.x_m
        shell.drive(2, 2)
        shell.run_ms(1500)
        assert robot.body.state.x_m > began_at + 0.1
        assert shell.code(1) != 0
        shell.set("p2dx_con", False)
        shell.run_ms(1500)
        robot.advance_to(esp32.now_us * NS_PER_US)
        assert robot.body.state.left_speed_mps == robot.body.state.right_speed_mps == 0
        assert [name for _, name in shell.commands[-4:]] == ["STOP", "VEL", "RVEL", "CLOSE"]
