"""What a client sees of its robot: ranges that are kept until a new reading, and poses from the packets alone."""

import math

import pytest

from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from robot_bench.recording.client_view import OdometryPose, SipRanges

P2DX = load_parameters("p2dx")
LONGEST_M = P2DX.sonar_range_m
METRES_A_COUNT = P2DX.range_um_per_count / 1e6


def packet(*sonar: tuple[int, int], **fields: int) -> bytes:
    readings = tuple(SonarReading(number, raw) for number, raw in sonar)
    return StandardSip(sonar=readings, **fields).to_frame(Profile.P2OS).to_bytes()


def test_each_reading_is_kept_until_the_next_of_its_sonar() -> None:
    heard: list[tuple[int, list[float]]] = []
    ranges = SipRanges(P2DX, Profile.P2OS, on_ranges=lambda now, metres: heard.append((now, [*metres])))
    whole = packet((0, 1000), (7, 2000))
    for now, data in enumerate((
        packet(), whole, whole[:-1], whole[:-1] + bytes([whole[-1] ^ 1]), b"\xfa\xfb\x03\x00\x00\x00",
        packet((1, 65535), (8, 100)), packet((0, 500)),
    )):  # fmt: skip
        ranges.take(data, now)
    still = [LONGEST_M] * 8
    first = [1000 * METRES_A_COUNT, *still[1:7], 2000 * METRES_A_COUNT]
    assert heard == [
        (1, pytest.approx(first)), (5, pytest.approx(first)), (6, pytest.approx([500 * METRES_A_COUNT, *first[1:]])),
    ]  # fmt: skip


def test_a_pose_is_that_of_the_counts_and_wheels_turn_by_arc_and_track() -> None:
    view = OdometryPose(P2DX)
    mm, quarter = P2DX.distance_nm_per_count / 1e6, P2DX.angle_counts_per_turn // 4
    view.take(StandardSip(raw_x=10, raw_y=32760), 0)
    straight = view.take(StandardSip(raw_x=110, raw_y=32760, raw_left_velocity=100, raw_right_velocity=-50), 5)
    assert (straight.t, straight.z, straight.pitch, straight.collisions, straight.heading) == (5, 0, 0, 0, 0)
    radius_mm = P2DX.body.wheel_diameter_m * 500
    turned = round(100 * mm / radius_mm * 1e6)
    assert straight.left_angle == straight.right_angle == pytest.approx(turned, abs=1)
    assert (straight.left, straight.right) == (
        100 * P2DX.velocity_um_s_per_count, -50 * P2DX.velocity_um_s_per_count,
    )  # fmt: skip
    assert view.distance_m == pytest.approx(0.1 * mm)
    # A quarter of a circle of 1000 counts' radius to the left, over the counter's end.
    bent = view.take(StandardSip(raw_x=1110, raw_y=(32760 + 1000) % 32768, raw_heading=quarter), 9)
    arc_mm, track_mm = 1000 * mm * math.pi / 2, P2DX.track_mm
    for angle, side in ((bent.left_angle, -1), (bent.right_angle, 1)):
        way_mm = 100 * mm + arc_mm + side * track_mm / 2 * math.pi / 2
        assert angle == pytest.approx(way_mm / radius_mm * 1e6, rel=1e-4)
    assert bent.heading == round(math.pi / 2 * 1e6)
    assert bent.y - straight.y == pytest.approx(1000 * mm * 1000, abs=1)
    assert bent.x - straight.x == pytest.approx(1000 * mm * 1000, abs=1)
    assert view.distance_m == pytest.approx(0.1 * mm + math.hypot(1000, 1000) * mm / 1000)
