"""Print how fast captures become columns: packets a second, and as a ratio to a C++ framer with checksum.

The first stream is one of mixed packet types and lengths; two more hold the SIPs
of 57 and 81 bytes that ARIA's receiver was measured with (1.6 million a second,
framed and checked only). 1 % of all frames are damaged. A part of each is decoded
both ways and compared row by row, and the C++ framer's count of frames with ours:
what differs ends the program. Times are those of one core. Usage: python tools/bench/columns.py [--quick] [--json]
"""

import json
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from itertools import zip_longest
from pathlib import Path

from measuring import IS_QUICK, cpu_s

from p2os.capture.columns import decode
from p2os.capture.columns.objects import rows_by_objects
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.packets import (
    BatteryPacket,
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GyroPacket,
    GyroReading,
    IoPacket,
    JoystickPacket,
    RawPacket,
    SerauxPacket,
    ServerPacket,
    SonarReading,
    StandardSip,
    packet_frame,
    read_packet,
)
from p2os.protocol.profiles import Profile

SEED = 20
PROFILE = Profile.AROS
RUNS, PACKETS = (3, 20_000) if IS_QUICK else (9, 400_000)
DAMAGED_SHARE = 0.01

FRAMER = r"""
// Frames and checksums of a stream in memory, re-scanning what it rejects; prints frames and seconds.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

static uint64_t scan(const uint8_t *data, size_t size, uint64_t &payload_bytes) {
    uint64_t frames = 0;
    size_t at = 0;
    while (at + 6 <= size) {
        if (data[at] != 0xFA || data[at + 1] != 0xFB) { ++at; continue; }
        const size_t count = data[at + 2];
        if (count < 3 || count > 204 || at + 3 + count > size) { ++at; continue; }
        const uint8_t *payload = data + at + 3;
        const size_t length = count - 2;
        uint32_t sum = 0;
        size_t i = 0;
        for (; i + 1 < length; i += 2) sum += payload[i] << 8 | payload[i + 1];
        sum &= 0xFFFF;
        if (i < length) sum ^= payload[i];
        if (sum == static_cast<uint32_t>(payload[length] << 8 | payload[length + 1])) {
            ++frames;
            payload_bytes += length;
            at += 3 + count;
        } else {
            ++at;
        }
    }
    return frames;
}

int main(int, char **arguments) {
    std::vector<uint8_t> data;
    std::FILE *file = std::fopen(arguments[1], "rb");
    if (!file) return 1;
    uint8_t block[65536];
    for (size_t got; (got = std::fread(block, 1, sizeof block, file)) > 0;) data.insert(data.end(), block, block + got);
    std::fclose(file);
    for (int run = std::atoi(arguments[2]); run > 0; --run) {
        uint64_t bytes = 0;
        const std::clock_t begin = std::clock();
        const uint64_t frames = scan(data.data(), data.size(), bytes);
        const double seconds = double(std::clock() - begin) / CLOCKS_PER_SEC;
        std::printf("%llu %llu %.9f\n", (unsigned long long)frames, (unsigned long long)bytes, seconds);
    }
}
"""


def packets(rng: random.Random) -> Callable[[], ServerPacket]:
    """Return what makes the next packet of the mix: as of a robot with every optional packet switched on."""

    def sip() -> ServerPacket:
        count = rng.choice((0, 2, 2, 2, 2, 4, 8, 16))
        tail = rng.choice((0, 0, 0, 7, 9))
        fields = (rng.getrandbits(16), rng.randrange(-1, 5), rng.randrange(-3000, 3000), rng.getrandbits(16),
                  rng.randrange(-900, 900), rng.randrange(-127, 100), rng.randrange(101), rng.getrandbits(32),
                  rng.getrandbits(32))  # fmt: skip
        return StandardSip(
            kind=rng.choice((0x32, 0x33)), raw_x=rng.getrandbits(15), raw_y=rng.getrandbits(15),
            raw_heading=rng.randrange(-2048, 2048), raw_left_velocity=rng.randrange(-2200, 2200),
            raw_right_velocity=rng.randrange(-2200, 2200), raw_battery=rng.randrange(100, 145),
            stall_left=rng.random() < 0.1, rear_bumpers=rng.getrandbits(7), front_bumpers=rng.getrandbits(7),
            raw_control=rng.randrange(-2048, 2048), raw_flags=rng.getrandbits(11), raw_compass=rng.getrandbits(8),
            sonar=tuple(SonarReading(number, rng.randrange(32001)) for number in range(count)),
            analog_port=5, gripper_state=rng.getrandbits(8), raw_analog=rng.getrandbits(8),
            digital_in=rng.getrandbits(8), digital_out=rng.getrandbits(8), tail=fields[:tail],
        )  # fmt: skip

    makers: list[Callable[[], ServerPacket]] = [
        *[sip] * 12,
        *[lambda: EncoderPacket(left_counts=rng.randrange(-(2**31), 2**31), right_counts=rng.randrange(2**31))] * 2,
        lambda: IoPacket(digital_in=tuple(rng.randbytes(4)), digital_out=tuple(rng.randbytes(1)),
                         raw_analog=tuple(rng.randrange(1024) for _ in range(9))),
        lambda: GyroPacket(readings=tuple(GyroReading(raw_rate=rng.randrange(1024), raw_temperature=60)
                                          for _ in range(rng.randrange(1, 5)))),
        lambda: SerauxPacket(port=rng.randrange(1, 4), data=rng.randbytes(rng.randrange(1, 24))),
        lambda: GripperPacket(gripper_type=2, state=rng.getrandbits(8), grasp_time=rng.getrandbits(8)),
        lambda: JoystickPacket(button1=rng.getrandbits(1), raw_x=rng.randrange(1024), raw_throttle=rng.randrange(1024)),
        lambda: CompassPacket(raw_compass=rng.randrange(3600), raw_pitch=rng.randrange(-300, 300)),
        lambda: RawPacket(0x7B, rng.randbytes(rng.randrange(12))),
        lambda: BatteryPacket(batteries=tuple(tuple(rng.randbytes(5)) for _ in range(2))),
    ]  # fmt: skip
    rare = ConfigPacket(subclass="p2dx", name="Wilma", fields_sent=66)

    def draw() -> ServerPacket:
        return rare if rng.random() < 0.001 else rng.choice(makers)()

    return draw


def stream(count: int, rng: random.Random) -> bytes:
    """Return so many frames of the mix, 1 % of them damaged."""
    draw = packets(rng)
    pool = [packet_frame(draw(), PROFILE).to_bytes() for _ in range(min(count, 10_000))]
    return b"".join(damaged(rng.choice(pool), rng) for _ in range(count))


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return a frame; 1 % of them with a wrong, a missing or a doubled byte."""
    if rng.random() >= DAMAGED_SHARE:
        return data
    place = rng.randrange(len(data))
    hit = rng.choice((b"", bytes((data[place] ^ 1 << rng.randrange(8),)), data[place : place + 1] * 2))
    return data[:place] + hit + data[place + 1 :]


def packets_as_objects(data: bytes) -> Iterator[ServerPacket]:
    """Yield every packet as an object, as a program that listens to a robot gets it."""
    decoder = Decoder()
    decoder.receive(data, 0)
    while (item := decoder.next_item()) is not None:
        if isinstance(item, Frame):
            yield read_packet(item, PROFILE)


def framer(data: bytes) -> tuple[int, float] | None:
    """Return how many frames the C++ framer finds and its seconds, or None without a compiler."""
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "framer.cpp").write_text(FRAMER, encoding="utf-8")
        (place / "stream.bin").write_bytes(data)
        program = str(place / "framer")
        subprocess.run([compiler, "-O2", "-std=c++17", "-o", program, str(place / "framer.cpp")], check=True)
        done = subprocess.run([program, str(place / "stream.bin"), str(RUNS)], check=True, capture_output=True)
    rows = [line.split() for line in done.stdout.decode("ascii").splitlines()]
    return int(rows[0][0]), min(float(row[2]) for row in rows)


def sips(count: int, sonar: int, rng: random.Random) -> bytes:
    """Return so many SIPs of ARCOS with so many sonar readings each, 1 % of them damaged."""
    pool = [
        StandardSip(
            raw_x=rng.getrandbits(15), raw_heading=rng.randrange(-2048, 2048), tail=(126, 2),
            sonar=tuple(SonarReading(number, rng.randrange(32001)) for number in range(sonar)),
        ).to_frame(PROFILE).to_bytes()
        for _ in range(2000)
    ]  # fmt: skip
    return b"".join(damaged(rng.choice(pool), rng) for _ in range(count))


def measure(data: bytes) -> dict[str, float]:
    """Return the figures of one stream."""
    part = data[:200_000]
    found: list[ServerPacket] = []
    took_s = cpu_s(lambda: found.extend(packets_as_objects(part)))
    objects = len(found) / took_s
    for number, (ours, theirs) in enumerate(zip_longest(decode(part, PROFILE).rows(), rows_by_objects(part, PROFILE))):
        if ours != theirs:
            sys.exit(f"packet {number}: the columns say {ours}, the objects {theirs}")
    count = len(decode(data, PROFILE))
    # What others on the machine disturb least.
    columns = count / min(cpu_s(lambda: decode(data, PROFILE)) for _ in range(RUNS))
    figures = {"packets": count, "bytes_a_packet": round(len(data) / count, 1),
               "columns_packets_a_second": round(columns), "objects_packets_a_second": round(objects)}  # fmt: skip
    compiled = framer(data)
    if compiled is not None:
        if compiled[0] != count:
            sys.exit(f"the C++ framer finds {compiled[0]} frames, the columns {count}")
        framed = count / compiled[1]
        figures |= {"framer_packets_a_second": round(framed), "columns_to_framer": round(columns / framed, 4)}
    return figures


def main() -> None:
    """Compare, measure, print."""
    rng = random.Random(SEED)
    streams = {
        "mixed types and lengths": stream(PACKETS, rng),
        "SIPs with 8 sonar readings": sips(PACKETS // 2, 8, rng),
        "SIPs with 16 sonar readings": sips(PACKETS // 2, 16, rng),
    }
    found = {name: measure(data) for name, data in streams.items()}
    if "--json" in sys.argv:
        print(json.dumps(found))
        return
    print("1 % of the frames damaged; every field decoded; rows equal to the objects', frames to the C++ framer's")
    print(
        f"{'million packets a second':<30}{'bytes each':>11}{'columns':>9}{'objects':>9}{'C++ framer':>12}{'ratio':>8}"
    )
    for name, row in found.items():
        speeds = (row[f"{kind}_packets_a_second"] / 1e6 for kind in ("columns", "objects"))
        columns, objects = speeds
        framed = (
            f"{row['framer_packets_a_second'] / 1e6:12.1f}" if "columns_to_framer" in row else f"{'no compiler':>12}"
        )
        ratio = f"{row['columns_to_framer']:8.3f}" if "columns_to_framer" in row else ""
        print(f"{name:<30}{row['bytes_a_packet']:>11}{columns:9.2f}{objects:9.3f}{framed}{ratio}")


if __name__ == "__main__":
    main()
