"""Random writes to all registers of all timers, and pins that change: no hang, no crash, the same in other slices."""

import random
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("unicorn")

from bluepill_sim import BluePill
from bluepill_sim.fabric.subscriptions import EDGE, Of

pytestmark = pytest.mark.usefixtures("watchdog")
#: Stack and reset vector, and there `b .`.
IDLE = (0x2000_5000).to_bytes(4, "little") + (0x0800_0009).to_bytes(4, "little") + b"\xfe\xe7\xfe\xe7"
TIMERS = ("TIM1", "TIM2", "TIM3", "TIM4")
PINS = [f"P{port}{n}" for port in "AB" for n in range(16) if f"P{port}{n}" not in {"PA13", "PA14"}]
#: What a write is likely to be: small periods, so that much happens, and anything.
WORDS = (0, 1, 2, 3, 7, 9, 0x11, 0x61, 0x80, 0x81, 0xFFFF, 0x6868, 0x3131, 0x0201, 0x1111, 0x8000, 0x9C10, 0xD003)


def story(seed: int, steps: int) -> list[tuple[Any, ...]]:
    """Return (time in ns, what, ...) of what is done to a board."""
    rng, at = random.Random(seed), 0
    found: list[tuple[Any, ...]] = [
        (0, "write", f"GPIO{port}", register, 0xBBBB_BBBB) for port in "AB" for register in ("CRL", "CRH")
    ]
    for name in TIMERS:  # all of them run, and drive their pins
        starts = {
            0x2C: rng.randrange(1, 40),
            0x34: rng.randrange(40),
            0x38: rng.randrange(40),
            0x18: 0x6868,
            0x1C: 0x3060,
        }
        starts |= {
            0x20: rng.choice((0x1111, 0x0555)),
            0x44: 0x8000 | rng.randrange(40),
            0x14: 1,
            0: rng.choice((1, 0x61)),
        }
        found += [(0, "offset", name, offset, word) for offset, word in starts.items()]
    for _ in range(steps):
        at += rng.choice((0, 125, 1_000, 7_777, 60_000))
        kind = rng.random()
        if kind < 0.15:
            found.append((at, "pin", rng.choice(PINS), rng.choice((False, True, None))))
        elif kind < 0.2:
            register = rng.choice(("GPIOA.CRL", "GPIOA.CRH", "GPIOB.CRL", "GPIOB.CRH"))
            word = int("".join(rng.choice("4BBBB8F") for _ in range(8)), 16)
            found.append((at, "write", *register.split("."), word))
        elif kind < 0.22:
            found.append((at, "write", "AFIO", "MAPR", rng.getrandbits(16) & 0x1FC0 | 2 << 24))
        elif kind < 0.3:
            found.append((at, "read", rng.choice(TIMERS), 4 * rng.randrange(20)))
        else:
            name = rng.choice(TIMERS)
            found.append(
                (at, "offset", name, 4 * rng.randrange(20), rng.choice((rng.choice(WORDS), rng.getrandbits(16))))
            )
    return found


def play(folder: Path, seed: int, steps: int, cuts: int) -> tuple[Any, ...]:
    """Return all that can be seen of it in the end."""
    (folder / "idle.bin").write_bytes(IDLE)
    board = BluePill(str(folder / "idle.bin"))
    parts, rng = board.chip.parts.by_name, random.Random(cuts)
    parts["RCC"].write(0x18, 4, 1 << 11 | 0x1D)
    parts["RCC"].write(0x1C, 4, 7)
    edges: list[tuple[int, ...]] = []
    board.subscribe_pins(PINS, lambda rows: edges.extend(EDGE.iter_unpack(rows)), of=Of.WIRE)
    seen: list[int] = []
    reported = story(seed, steps)
    for at, what, *more in [*reported, (reported[-1][0] + 500_000, "end")]:
        while cuts and board.now_ns < at and rng.random() < 0.7:
            board.advance_to(min(at, board.now_ns + rng.randrange(1, 20_000)))
        board.advance_to(at)
        if what == "pin":
            board.pin(more[0]).drive(more[1])
        elif what == "write":
            part = parts[more[0]]
            part.write(next(r.offset for r in part.REGISTERS if r.name == more[1]), 4, more[2])
        elif what == "read":
            seen.append(parts[more[0]].read(more[1], 4))
        elif what == "offset":
            parts[more[0]].write(more[1], 4, more[2])
    ends = [(parts[name].words.tobytes(), parts[name].held, parts[name].due_ns) for name in TIMERS]
    return board.cycle, seen, edges, ends, board.chip.processor.nvic.pending


@pytest.mark.parametrize("seed", range(6))
def test_random_writes_end_alike_in_other_slices(tmp_path: Path, seed: int) -> None:
    whole = play(tmp_path, seed, 120, 0)
    assert play(tmp_path, seed, 120, 1 + seed) == whole
    assert whole[2], "no pin has moved"
