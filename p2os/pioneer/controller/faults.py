"""Faults on request: what is injected now, and the words that inject and clear it.

A fault is a line of words, the same in a scenario and at the control line of
`p2os serve`; `FAULTS` lists them. `clear` with the same first words ends it.

    sonar-stuck 3 1.2        sonar 3 (from 1) gives 1.2 m whatever is there
    line-noise 0.001         one bit in a thousand is flipped, both ways

Line faults corrupt bytes on their way; the random streams are the robot's
own, so that a run with faults repeats. What injecting one does to the robot is in
`fault_actions`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from p2os.pioneer.controller.order_words import Range, read_words
from p2os.pioneer.random_source import RandomSource
from simbase.errors import UsageError, nearest

#: chosen: a loose contact swallows 1 to so many bytes at a time.
LONGEST_GAP_BYTES = 40
#: chosen: how often a byte begins a gap.
GAP_PROBABILITY = 0.02

#: First word → (the others, what happens).
FAULTS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "sonar-stuck": (("NUMBER", "METRES"), "a sonar, counted from 1, always gives the same range"),
    "sonar-noisy": (("NUMBER", "METRES"), "a sonar errs by this standard deviation"),
    "sonar-dead": (("NUMBER",), "a sonar gets no echo"),
    "wheel-blocked": (("SIDE",), "the left or right wheel does not turn; its motor stalls"),
    "loose-connector": ((), "runs of bytes are lost, both ways"),
    "line-noise": (("RATE",), "so many of the bits are flipped, both ways"),
    "low-battery": (("VOLTS",), "the voltmeter shows so much"),
    "brown-out": ((), "the supply dips: the controller starts anew, motors off"),
    "reboot": ((), "the controller starts anew"),
    "stop-button": ((), "the red button is pressed: motors off until it is cleared and ENABLE comes"),
    "bumper": (("SIDE", "SEGMENT"), "a segment of the front or rear bumper, counted from 1, is pressed"),
}
SIDES = {"wheel-blocked": ["left", "right"], "bumper": ["front", "rear"]}
#: Happen once: there is nothing to clear.
MOMENTARY = frozenset({"brown-out", "reboot"})
#: Values of faults; to clear one, they may be left out.
VALUES: Mapping[str, Range] = {"METRES": (0.0, 100.0), "RATE": (0.0, 0.5), "VOLTS": (0.0, 25.5)}


@dataclass(frozen=True, slots=True)
class RobotFault:
    """One fault, read and checked."""

    name: str
    side: str = ""
    number: int = 0
    value: float = 0.0

    @property
    def text(self) -> str:
        """The words that make it."""
        value = {"NUMBER": str(self.number), "SEGMENT": str(self.number), "SIDE": self.side}
        return " ".join([self.name, *(value.get(word, f"{self.value:g}") for word in FAULTS[self.name][0])])


def read_fault(text: str, *, sonar: int, complete: bool = True) -> RobotFault:
    """Read the words of a fault.

    Args:
        text: The words.
        sonar: How many sonar the robot has.
        complete: Whether the value at the end must be there; to clear a fault it need not.

    Raises:
        UsageError: There is no such fault, or a word is missing or out of range.
    """
    name, *rest = text.split() or [""]
    if name not in FAULTS:
        hint = nearest(name, FAULTS, f"faults: {', '.join(FAULTS)}")
        raise UsageError(f"no fault {name!r}" if name else "which fault?", hint=hint)
    words = [f"[{word}]" if word in VALUES and not complete else word for word in FAULTS[name][0]]
    ranges: dict[str, Range] = {**VALUES, "SIDE": SIDES.get(name), "NUMBER": (1, sonar), "SEGMENT": (1, 7)}
    values = read_words(text, name, rest, words, ranges)
    number = values.get("NUMBER", values.get("SEGMENT", 0))
    value = next((values[word] for word in VALUES if word in values), 0.0)
    return RobotFault(name, str(values.get("SIDE", "")), int(number), float(value))


@dataclass(slots=True)
class Faults:
    """What is injected now, as far as it is not a device's own state."""

    #: 0-based sonar → (stuck, noisy or dead; value).
    sonar: dict[int, tuple[str, float]] = field(default_factory=dict)
    left_blocked: bool = False
    right_blocked: bool = False
    is_loose: bool = False
    bit_error_rate: float = 0.0
    #: Bytes that the loose contact still swallows, to the robot and from it.
    gap_in: int = 0
    gap_out: int = 0

    @property
    def corrupts_line(self) -> bool:
        """Whether bytes are lost or changed on their way."""
        return self.is_loose or self.bit_error_rate > 0

    def corrupt(self, data: bytes, random_source: RandomSource, *, to_robot: bool) -> bytes:
        """Return what is left of bytes that pass the line."""
        stream = random_source.of("line in" if to_robot else "line out")
        gap = self.gap_in if to_robot else self.gap_out
        found = bytearray()
        for byte in data:
            if self.is_loose and not gap and stream.random() < GAP_PROBABILITY:
                gap = stream.randint(1, LONGEST_GAP_BYTES)
            if gap:
                gap -= 1
                continue
            if self.bit_error_rate and stream.random() < 1 - (1 - self.bit_error_rate) ** 8:
                byte ^= 1 << stream.randrange(8)  # noqa: PLW2901 - the byte that arrives
            found.append(byte)
        if to_robot:
            self.gap_in = gap
        else:
            self.gap_out = gap
        return bytes(found)
