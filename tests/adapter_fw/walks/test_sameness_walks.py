"""Model and firmware over the same random lives: alike at each step, and as approved."""

import random
import zlib
from collections.abc import Callable, Iterator, Mapping

from adapter_sim import AdapterSettings
from adapter_sim.codec import BitOrder
from adapter_sim.masters import Master
from adapter_sim.settings import EncoderAtOpen, MotorCommand, MotorMeaning
from robot_bench.adapter import is_available
from tests.adapter_fw.sequences import Sequence
from tests.adapter_fw.twins import MS, Twins
from tests.tools.suite.approved import Trace, judge_of, said


def settings_of(draw: random.Random) -> AdapterSettings:
    return AdapterSettings(
        threshold_um=draw.choice((None, 600_000, 1_300_000)),
        motor_command=draw.choice((MotorCommand.BITS, MotorCommand.BITS, MotorCommand.DUTY)),
        bit_order=draw.choice(tuple(BitOrder)),
        motor_meaning=draw.choice(tuple(MotorMeaning)),
        step_um_per_s=draw.choice((62_500, 100_001, 250_000, 400_000)),
        angular_step_urad_per_s=draw.choice((425_000, 100_000, 2_000_000)),
        max_velocity_mm_s=draw.choice((None, None, 0, 150)),
        max_rotation_deg_s=draw.choice((None, None, 17)),
        sample_count=draw.choice((1, 3, 5, 9)),
        sample_period_ns=draw.choice((2 * MS, 5 * MS)),
        connect_after_ns=draw.choice((0, 10 * MS)),
        disconnect_after_ns=draw.choice((0, 10 * MS)),
        duty_timeout_ns=draw.choice((25 * MS, 7 * MS)),
        encoder_at_open=draw.choice(tuple(EncoderAtOpen)),
        encoder_dwell_ns=draw.choice((0, 20 * MS)),
        stop_unknown_robot=draw.random() < 0.7,
        stop_repeats=draw.choice((0, 3)),
        pulse_ns=draw.choice((100 * MS, 1_000 * MS)),
        pad_velocity_mm_s=draw.choice((400, 1_000, 3_000)),
        pad_trigger_dead=draw.choice((0, 40)),
        bauds=draw.choice(((9_600,), (9_600, 38_400, 115_200))),
    )


SPEEDS = (-400, -60, -1, 0, 1, 30, 300)
PASSING = (1, 999_999, 2 * MS, 25 * MS, 60 * MS, 99 * MS, 100 * MS, 240 * MS, 351 * MS, 1_100 * MS)


def heading(draw: random.Random) -> int:
    return draw.randint(-0x8000, 0x7FFF)


def readings(draw: random.Random) -> list[tuple[int, int]]:
    return [(draw.randint(0, 9), draw.choice((0, 599, 600, 601, 1_300, 0xFFFF))) for _ in range(draw.choice((0, 2, 4)))]


def wave(draw: random.Random) -> tuple[int, int]:
    period = draw.choice((50_000, MS, 20 * MS, 25 * MS))
    return period, draw.choice((1, period // 3, period - 1))


#: What a step of a kind is given.
GIVEN: Mapping[str, Callable[[random.Random], tuple[object, ...]]] = {
    "motors": lambda draw: (draw.randint(-4, 3), draw.randint(-4, 3)),
    "sips": lambda draw: (
        *(draw.choice((1, 3, 11)), draw.choice((-60, 0, 7, 60)), heading(draw)),
        *(draw.choice(SPEEDS), draw.choice(SPEEDS)),
    ),
    "sip": lambda draw: (
        *(draw.getrandbits(16), draw.choice((0, 0x7FFF, 0x8000, 5)), heading(draw)),
        *(draw.choice((-0x8000, -70, 0, 70)), draw.random() < 0.3, readings(draw)),
    ),
    "pwm": lambda draw: (draw.choice((1, 2)), *wave(draw), draw.choice((1, 4)), draw.random() < 0.5),
    "obey": lambda draw: (draw.choice((1, 6)),),
    "noise": lambda draw: (draw.choice((b"", b"\xfa", b"\xfa\xfb\x03", bytes(9), draw.randbytes(30))),),
    "damaged": lambda draw: (draw.randrange(60), draw.choice((1, 0x80, 0xFF))),
    "frame": lambda draw: (
        draw.choice((0, 1, 2, 0x20, 0x32, 0x90, 0xFE, 0xFF)),
        draw.randbytes(draw.choice((0, 1, 8))),
    ),
    "pin": lambda draw: (draw.choice(("p2dx_con", "motor1_comm1", "motor2_comm3")), draw.random() < 0.5),
    "glitch": lambda draw: (draw.choice(("p2dx_con", "motor1_comm2", "rst")), draw.choice((1, 3, 9, 14))),
    "time": lambda draw: (draw.choice(PASSING),),
    "connect": lambda draw: (draw.random() < 0.5,),
    "pad": lambda draw: (
        *(draw.random() < 0.4, draw.random() < 0.2, draw.choice((0, 40, 41, 1023)), draw.choice((0, 1023))),
        draw.choice((-512, -40, 0, 41, 511)),
    ),
    "drive by pad": lambda draw: (draw.choice((0, 41, 500, 1023)), draw.choice((-512, 0, 300))),
    "master": lambda draw: (draw.choice(tuple(Master)),),
    "late": lambda draw: (
        draw.choice(("sip", "sip", "sip", "answer", "pad", "pad", "pad", "master", "shutdown")),
        draw.choice((0, 1, 1, 2)),
    ),
    "rare": lambda draw: (draw.choice(("shutdown", "reset", "restore", "half frame")),),
}
#: What keeps a session going comes often, what ends it seldom.
KINDS = (
    *("motors", "motors", "sips", "sips", "sip", "obey", "obey", "pwm", "noise", "damaged", "frame", "pin", "glitch"),
    *("late", "late", "time", "time", "connect", "connect", "pad", "drive by pad", "master", "rare"),
)


def life(draw: random.Random, *, steps: int = 28) -> Iterator[str]:
    has_four_bits = draw.random() < 0.3
    settings = settings_of(draw)
    sequence = Sequence(
        settings,
        has_four_bits=has_four_bits,
        robot=draw.choice(("p2dx", "p3dx", "p3at")),
        has_uart=draw.random() < 0.3,
        waits_for_edges=draw.random() < 0.3,
    )
    twins, seen = sequence.twins, watched(sequence.twins)
    for step in range(steps):
        kind = "connect" if step % 9 == 0 else draw.choice(KINDS)
        sequence.step(kind, *GIVEN[kind](draw))
        yield said(
            [kind, twins.now, twins.model.status, zlib.crc32(said(seen).encode()), [one for one in seen if one[0]]]
        )
        seen.clear()


def watched(twins: Twins) -> list[tuple[object, ...]]:
    """Return where goes what comes out of the model, before it is compared and forgotten: events, then the rest."""
    seen, side, compare = list[tuple[object, ...]](), twins.sides[0], twins.compare

    def look() -> None:
        kept = len(side.frames)
        side.collect()
        seen.extend([*side.events, (0, side.frames[kept:], [*side.pins.writes])])
        compare()

    twins.compare = look  # type: ignore[method-assign]
    return seen


def lives(draw: random.Random) -> Iterator[str]:
    for _ in range(5):
        yield from life(draw)


TRACES: dict[str, Trace] = dict.fromkeys(("one", "two", "three"), lives) if is_available() else {}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
