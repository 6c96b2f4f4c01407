"""A bad line, unplugged cables and rebooting robots: what the adapter promises holds all along.

Derivation. A SIP with all eight sonar is 54 bytes, 540 bits on the line. At a bit
error rate of 1e-4 it is damaged with 1 - (1 - 1e-4)^540 = 5.3 %. A single flip never
passes the 16-bit sum. Of two flips those pass that fall into the same column of the
sum and cancel: counted on a real packet below, times 1e-8, times 36,000 packets an
hour, it is about one.
"""

from itertools import combinations
from math import sqrt

import pytest

from p2os.protocol.frames import checksum
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from robot_bench.adapter import is_available
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.adapter_fw.hard_conditions import BITS_PER_CHARACTER, HardConditions

pytestmark = pytest.mark.skipif(not is_available(), reason="the firmware core is not built: no C++17 compiler")

BIT_ERROR_RATE = 1e-4
PACKETS_AN_HOUR = 36_000
#: A refresh each 200 ms, a pair on the line (18.75 ms), the spacing to the last pair (25 ms), and the look every 20 ms.
REFRESH_MS = 200 + 18.75 + 25 + 20
SIP = StandardSip(
    raw_x=1_234, raw_y=31_000, raw_heading=-700, raw_left_velocity=180, raw_right_velocity=190, raw_battery=126,
    sonar=tuple(SonarReading(number, 1_000 + 777 * number) for number in range(8)),
)  # fmt: skip


def test_five_percent_of_packets_are_damaged_and_about_one_an_hour_passes_its_sum() -> None:
    frame = SIP.to_frame(Profile.P2OS).to_bytes()
    assert len(frame) == 54
    assert 1 - (1 - BIT_ERROR_RATE) ** (BITS_PER_CHARACTER * len(frame)) == pytest.approx(0.0526, abs=0.0005)
    payload, words = frame[3:-2], frame[3:]
    # What a flip adds to (sum of the data) - (sum that was sent), modulo 65536; the odd last byte is XORed in.
    assert len(payload) % 2 == 1
    total = (checksum(payload) ^ payload[-1]) & 0xFFFF
    effects = []
    for place, byte in enumerate(words):
        for bit in range(8):
            sign = -1 if byte >> bit & 1 else 1
            if place < len(payload) - 1:
                effects.append(("sum", sign << (bit + (0 if place % 2 else 8))))
            elif place == len(payload) - 1:
                effects.append(("xor", 1 << bit))
            else:
                effects.append(("sent", sign << (bit + (8 if place == len(words) - 2 else 0))))

    def passes(flips: tuple[tuple[str, int], ...]) -> bool:
        summed = sum(effect for kind, effect in flips if kind == "sum")
        sent = sum(effect for kind, effect in flips if kind == "sent")
        last = payload[-1]
        for kind, effect in flips:
            last ^= effect if kind == "xor" else 0
        return ((total + summed) ^ last) & 0xFFFF == (checksum(payload) + sent) & 0xFFFF

    assert not any(passes((flip,)) for flip in effects), "one flip never passes"
    pairs = sum(passes(pair) for pair in combinations(effects, 2))
    assert 0.5 < pairs * BIT_ERROR_RATE**2 * PACKETS_AN_HOUR < 2


def keeps_its_promises(case: HardConditions, span_ns: int, *, unplug: int, reboot: int, forge: int) -> None:
    case.run(span_ns, unplug=unplug, reboot=reboot, forge=forge)
    case.drain()
    counts, back = case.counts, case.back
    assert (counts["unplugged"], counts["reboots"]) == (unplug, reboot)
    assert counts["losses"] >= (unplug + reboot) // 4
    assert counts["sessions"] > counts["losses"] // 2
    assert counts["code_steps"] > span_ns // NS_PER_S // 2, "it has driven"
    # Damage is as derived, within four standard deviations.
    share = 1 - (1 - BIT_ERROR_RATE) ** (BITS_PER_CHARACTER * 54)
    room = 4 * sqrt(share * (1 - share) / back.frames)
    assert abs(back.damaged / back.frames - share) < room + 0.003, "short frames of the handshake are among them"
    # Two refreshes may be damaged in a row: 0.9 % each; three are a matter of days.
    assert case.longest_wrong_ns <= 3 * REFRESH_MS * NS_PER_MS
    # A count that grew by a flip takes the frames behind it for its own, in the robot's decoder. Wheels that do not
    # follow for a second are implausible: a SIP later at the latest the robot is stopped.
    assert case.longest_hidden_ns <= 1_000 * NS_PER_MS + 100 * NS_PER_MS + REFRESH_MS * NS_PER_MS
    # Each frame is either taken or counted as rejected; one an hour passes that should not.
    numbers = case.rig.adapter.numbers
    whole = back.frames - back.damaged
    assert 0 <= numbers["frames"] - whole <= 10
    rejected = numbers["bad_checksums"] + numbers["bad_counts"] + numbers["stalled"]
    assert rejected + numbers["noise_bytes"] >= back.damaged
    assert numbers["bad_checksums"] > back.damaged // 2
    assert numbers["overflows"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_a_minute_of_hard_conditions(seed: int) -> None:
    keeps_its_promises(HardConditions(seed, bit_error_rate=BIT_ERROR_RATE), 60 * NS_PER_S, unplug=3, reboot=3, forge=3)


@pytest.mark.soak
@pytest.mark.parametrize("seed", [2, 3])
def test_an_hour_of_hard_conditions_with_a_hundred_unplugged_cables_and_a_hundred_reboots(seed: int) -> None:
    keeps_its_promises(
        HardConditions(seed, bit_error_rate=BIT_ERROR_RATE), 3_600 * NS_PER_S, unplug=100, reboot=100, forge=60
    )


def test_a_wrong_speed_that_passes_is_overwritten_by_the_next_refresh() -> None:
    case = HardConditions(5, bit_error_rate=0.0)
    case.run(2 * NS_PER_S, unplug=0, reboot=0)
    case._motors_at = 1 << 62
    case.rig.pins.motors(2, 2, case.rig.now)
    case.run(NS_PER_S, unplug=0, reboot=0)
    assert case.received.speeds["VEL"] == 125
    case._forge()
    assert case.received.speeds["VEL"] == 200
    case.run(200 * NS_PER_MS + 25 * NS_PER_MS, unplug=0, reboot=0)
    assert case.received.speeds["VEL"] == 125
