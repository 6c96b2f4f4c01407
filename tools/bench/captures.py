"""Print how fast large captures are read and written: packets a second of processor time, and the most memory.

One stream of SIPs of 49 bytes on the average: as raw bytes, as a recording with one packet a chunk, as a capture file
of ours with one packet a record, and as TCP on Ethernet with one packet a segment; each through the `p2os` command,
whose start is counted. `base` is what runs without NumPy. Usage: python tools/bench/captures.py [--quick] [--json]
"""

import json
import os
import random
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path

from p2os.capture import Chunk, Direction, write_pcap, write_recording
from p2os.capture.chunks import Capture
from p2os.capture.formats.pcap_records import FILE_HEADER, MAGIC_NS, RECORD_HEADER
from p2os.protocol.packets import SonarReading, StandardSip, packet_frame
from p2os.protocol.profiles import Profile

SEED = 20
PACKETS = 20_000 if "--quick" in sys.argv else 1_700_000
#: Without NumPy, and line by line, as many are enough.
FEW = min(PACKETS, 200_000)
#: A packet each, seconds.
CYCLE_NS = 100_000_000
#: How the program is started: as installed, and as without NumPy.
STARTS = {
    "": (sys.executable, "-m", "p2os"),
    "base": (sys.executable, "-c", "import sys; sys.modules['numpy'] = None; from p2os.__main__ import main; main()"),
}
#: What is done, with what is installed, and whether to all packets.
WORK = {
    "Parquet": ("", True, ("export", "{capture}", "{folder}/out.parquet", "--force")),
    "Arrow": ("", True, ("export", "{capture}", "{folder}/out.arrow", "--force")),
    "CSV": ("", True, ("export", "{capture}", "{folder}/out.csv", "--force")),
    "damage": ("", True, ("decode", "{capture}", "--only", "damaged")),
    "lines": ("", False, ("decode", "{capture}")),
    "CSV, base": ("base", False, ("export", "{capture}", "{folder}/out.csv", "--force")),
}


def stream(count: int, rng: random.Random) -> list[bytes]:
    """Return so many SIPs of a Pioneer 2 with two or eight sonar readings."""
    pool = [
        packet_frame(
            StandardSip(
                raw_x=rng.getrandbits(15), raw_y=rng.getrandbits(15), raw_heading=rng.randrange(-2048, 2048),
                raw_left_velocity=rng.randrange(-2200, 2200), raw_right_velocity=rng.randrange(-2200, 2200),
                raw_battery=rng.randrange(100, 145), raw_compass=rng.getrandbits(8),
                sonar=tuple(
                    SonarReading(rng.randrange(16), rng.randrange(5001)) for _ in range(rng.choice((2, 8, 8, 8)))
                ),
            ),
            Profile.P2OS,
        ).to_bytes()
        for _ in range(5000)
    ]  # fmt: skip
    return [rng.choice(pool) for _ in range(count)]


def segments(packets: list[bytes]) -> Iterator[bytes]:
    """Yield a capture file in which each packet is a TCP segment on Ethernet."""
    yield struct.pack("<" + FILE_HEADER, MAGIC_NS, 2, 4, 0, 0, 65535, 1)
    ends = b"\x7f\0\0\1" * 2 + struct.pack(">HH", 8101, 40000)
    sequence = 1
    for number, data in enumerate(packets):
        tcp = struct.pack(">IIBBHHH", sequence & 0xFFFFFFFF, 0, 5 << 4, 0x18, 1000, 0, 0)
        head = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(data), 0, 0, 64, 6, 0)
        packet = bytes(12) + b"\x08\0" + head + ends + tcp + data
        seconds, nanoseconds = divmod(number * CYCLE_NS, 10**9)
        yield struct.pack("<" + RECORD_HEADER, seconds, nanoseconds, len(packet), len(packet)) + packet
        sequence += len(data)


def write_captures(folder: Path, packets: list[bytes]) -> dict[str, Path]:
    """Write the stream in each container."""
    chunks = tuple(
        Chunk(at_ns=number * CYCLE_NS, direction=Direction.FROM_ROBOT, data=data) for number, data in enumerate(packets)
    )
    found = {name: folder / name for name in ("raw.bin", "recording.jsonl", "records.pcap", "segments.pcap")}
    found["raw.bin"].write_bytes(b"".join(packets))
    found["recording.jsonl"].write_text(write_recording(Capture(chunks=chunks)), encoding="ascii")
    found["records.pcap"].write_bytes(write_pcap(chunks))
    with found["segments.pcap"].open("wb") as file:
        file.writelines(segments(packets))
    return found


def written(folder: Path, count: int) -> dict[str, Path]:
    """Make so many packets and write them in each container."""
    return write_captures(folder, stream(count, random.Random(SEED)))


def measured(words: tuple[str, ...]) -> dict[str, float]:
    """Run a program; return seconds of processor time, MB at the most, and wall seconds until its first line."""
    began = time.monotonic()
    read_end, write_end = os.pipe()
    process = subprocess.Popen(words, stdout=write_end, stderr=subprocess.DEVNULL)
    os.close(write_end)
    with os.fdopen(read_end, "rb") as output:
        first_s = time.monotonic() - began if output.readline() else 0.0
        while output.read(1 << 16):
            pass
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{' '.join(words)} ended with code {process.returncode}")
    return {"cpu_s": usage.ru_utime + usage.ru_stime, "mb": usage.ru_maxrss / 1024, "first_s": first_s}


def main() -> None:
    """Write, run, print."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "few").mkdir()
        # In a process of its own: what a program takes at the most counts that of the one that starts it.
        with get_context("spawn").Pool(1) as pool:
            whole = pool.apply(written, (folder, PACKETS))
            few = pool.apply(written, (folder / "few", FEW))
        for work, (start, is_whole, words) in WORK.items():
            for kind, path in (whole if is_whole else few).items():
                filled = tuple(word.format(capture=path, folder=folder) for word in words)
                found = measured((*STARTS[start], *filled))
                count = PACKETS if is_whole else FEW
                rows.append({"work": work, "capture": kind, "packets": count,
                             "packets_a_second": round(count / found["cpu_s"]), **found})  # fmt: skip
    if "--json" in sys.argv:
        print(json.dumps(rows))
        return
    print(f"{'':<11}{'capture':<17}{'packets':>10}{'packets/s of CPU':>18}{'MB':>6}{'first line, s':>15}")
    for row in rows:
        first = f"{row['first_s']:15.1f}" if row["work"] == "lines" else ""
        print(
            f"{row['work']:<11}{row['capture']:<17}{row['packets']:>10,}{row['packets_a_second']:>18,}{row['mb']:>6.0f}{first}"
        )


if __name__ == "__main__":
    main()
