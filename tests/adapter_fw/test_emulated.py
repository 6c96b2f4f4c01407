"""The real image of the firmware, in an emulator of the ESP32, and the model: same frames, same times.

Both are brought by whoever runs this; without them it is skipped, and says what is missing. A life is one of
test_program_as_model.py. The image's adapter begins between two ticks of the system, the model's on one, so what counts
from its start may fall into the pass before or after; nothing may lie further apart than that.
"""

import pytest

from tests.adapter_fw.emulated import EmulatedEsp32, named
from tests.adapter_fw.test_program_as_model import Both

#: A pass, and what the chip needs for one: interrupts, the task, the driver.
MOST_US = 1_000 + 200


def live(seed: int) -> int:
    """Live a life in image and model; return how many frames both have sent."""
    names = named()
    if isinstance(names, str):
        pytest.skip(names)
    chip = EmulatedEsp32(*names)
    try:
        both = Both(chip)
        both.run_ms(1)
        both.live(seed)
        assert chip.lost == 0
        return both.compare(MOST_US)
    finally:
        chip.close()


@pytest.mark.slow
def test_the_image_and_the_model_send_the_same_frames_at_the_same_times() -> None:
    assert live(0) > 20


@pytest.mark.soak
def test_the_image_and_the_model_are_the_same_over_a_hundred_lives() -> None:
    assert sum(map(live, range(100))) > 5_000
