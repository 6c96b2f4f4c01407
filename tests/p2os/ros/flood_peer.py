"""A peer that asks for the same speed as often as it is told to, over zenoh or DDS: `flood_peer.py ZENOH|DOMAIN HZ S`.

It imports nothing of p2os, ends by itself, and then prints how many messages a second it has sent.
"""

import contextlib
import json
import struct
import sys
import time
from collections.abc import Callable, Iterator

TWIST = "geometry_msgs::msg::dds_::Twist_/RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
SPEED_MPS = 0.2
#: Sent between two looks at the clock.
BURST = 100


@contextlib.contextmanager
def zenoh_speed(place: str) -> Iterator[Callable[[], object]]:
    """Yield what sends the speed once, to a router."""
    import zenoh

    config = zenoh.Config()
    rows: tuple[tuple[str, object], ...] = (
        ("mode", "client"), ("connect/endpoints", [f"tcp/{place}"]), ("scouting/multicast/enabled", False),
    )  # fmt: skip
    for key, value in rows:
        config.insert_json5(key, json.dumps(value))
    data = bytes((0, 1, 0, 0)) + struct.pack("<6d", SPEED_MPS, 0, 0, 0, 0, 0)
    with zenoh.open(config) as session:
        publisher = session.declare_publisher(f"0/cmd_vel/{TWIST}")
        yield lambda: publisher.put(data, attachment=struct.pack("<qqB16s", 1, 0, 16, bytes(16)))


@contextlib.contextmanager
def dds_speed(domain: int) -> Iterator[Callable[[], object]]:
    """Yield what sends the speed once, in a domain of this machine."""
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic
    from raw_peer import LOOPBACK, QOS, Twist, Vector3  # beside this script

    network, node = Domain(domain, LOOPBACK), DomainParticipant(domain)
    writer = DataWriter(node, Topic(node, "rt/cmd_vel", Twist), qos=QOS)
    speed = Twist(Vector3(SPEED_MPS), Vector3())

    def send() -> None:
        with contextlib.suppress(DDSException):  # nobody takes any more
            writer.write(speed)

    yield send
    del network


def flood(send: Callable[[], object], rate_hz: int, lasts_s: float) -> float:
    """Send so often, and no longer than that; return how often it was, Hz."""
    began, sent = time.monotonic(), 0
    while (past_s := time.monotonic() - began) < lasts_s:
        if sent > past_s * rate_hz:
            time.sleep(0.0002)
            continue
        for _ in range(BURST):
            send()
        sent += BURST
    return sent / (time.monotonic() - began)


if __name__ == "__main__":
    where, rate, lasts = sys.argv[1:]
    with zenoh_speed(where) if ":" in where else dds_speed(int(where)) as sender:
        sys.stdout.write(f"{flood(sender, int(rate), float(lasts)):.0f}\n")
