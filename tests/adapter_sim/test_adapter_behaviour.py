"""What the adapter does with a robot behind a line of 9600 baud."""

import pickle
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise

import pytest

from adapter_sim import Adapter, AdapterSettings, EncoderAtOpen, parse_pinout
from adapter_sim.adapter import AdapterState
from adapter_sim.mixing import CommandedSpeeds
from adapter_sim.session import SessionEnded
from p2os.protocol.sip import SonarReading, StandardSip
from simbase.errors import UsageError
from tests.adapter_sim.conftest import MS, PARAMETERS, PINOUT, FakePins, FakeRobot, Rig, four_bits

#: The count of the right wheel at which a new adapter begins: the code that its wires show before, by their pulls.
RIGHT_BEGINS = 4


def names(rig: Rig, since: int = 0) -> list[str]:
    return [name for _, name, _ in rig.sent(since)]


def test_connecting_stops_syncs_opens_and_enables_in_order(driving: Rig) -> None:
    assert names(driving)[:15] == [
        "STOP", "VEL", "RVEL",  # at boot
        "STOP", "VEL", "RVEL", "PULSE", "OPEN", "CLOSE",  # PULSE, OPEN, CLOSE are SYNC0, 1, 2 here
        "OPEN", "SETO", "SONAR", "ENABLE", "VEL", "RVEL",
    ]  # fmt: skip
    assert [what for _, what, _ in driving.events] == ["booted", "connecting", "connected", "driving"]
    assert driving.events[2][2] == "Pioneer p2dx Fake"


def test_every_sync0_has_the_stop_before_it_while_nobody_answers() -> None:
    rig = Rig()
    rig.to_robot.cut = True
    rig.pins.set("p2dx_con", True, 0)
    rig.ms(8_000)
    sent = names(rig)[3:]
    assert sent.count("PULSE") >= 7
    assert sent == ["STOP", "VEL", "RVEL", "PULSE"] * sent.count("PULSE")
    assert any(what == "no connection" and why.endswith("tries again in 1.0 s") for _, what, why in rig.events)
    rig.to_robot.cut = False
    rig.ms(3_000)
    assert rig.adapter.state == "driving"


def test_a_peer_that_counts_any_packet_as_a_sync_gets_syncs_only() -> None:
    rig = Rig(AdapterSettings(threshold_um=600_000, stop_unknown_robot=False))
    rig.connect()
    assert names(rig)[:5] == ["PULSE", "OPEN", "CLOSE", "OPEN", "SETO"]


def test_a_streaming_robot_is_stopped_and_closed_before_it_is_synced(driving: Rig) -> None:
    driving.pins.motors(3, 3, driving.now)
    driving.ms(300)
    assert driving.robot.forward == 188
    # The adapter is replaced while the robot drives: the new one knows nothing of it.
    new = Rig(robot=driving.robot, now=driving.now)
    new.pins.set("p2dx_con", True, new.now)
    new.ms(350)
    assert new.robot.forward == 0
    new.ms(1_500)
    assert new.adapter.state == "driving"
    sent = names(new)
    assert sent.index("CLOSE") < sent.index("OPEN")
    assert new.robot.forward == 0


def test_p2dx_con_low_stops_and_closes_within_50_ms(driving: Rig) -> None:
    driving.pins.motors(3, 3, driving.now)
    driving.ms(300)
    fell = driving.now
    driving.pins.set("p2dx_con", False, fell)
    driving.ms(600)
    stop_at = next(at for at, name, _ in driving.sent(fell) if name == "STOP")
    # 2 ms to the first low sample and 10 ms of debounce; then a pair on the line and the STOP itself.
    assert stop_at <= fell + 12 * MS
    assert driving.robot.commands[-1][1].name == "RVEL"
    assert driving.robot.forward == 0
    assert not driving.robot.connection.is_open
    assert driving.adapter.state == "idle"
    # The robot fell silent, so the stop sequence was not sent again.
    assert names(driving, fell).count("CLOSE") == 1


def test_a_close_that_gets_lost_is_sent_again(driving: Rig) -> None:
    driving.to_robot.cut = True
    driving.pins.set("p2dx_con", False, driving.now)
    driving.ms(150)
    driving.to_robot.cut = False
    driving.ms(200)
    assert not driving.robot.connection.is_open


def test_p2dx_con_again_connects_again(driving: Rig) -> None:
    driving.pins.set("p2dx_con", False, driving.now)
    driving.ms(20)
    driving.pins.set("p2dx_con", True, driving.now)
    driving.ms(1_500)
    assert driving.adapter.state == "driving"


def test_after_a_loss_nothing_moves_until_p2dx_con_is_given_anew(driving: Rig) -> None:
    driving.pins.motors(3, 3, driving.now)
    driving.to_adapter.cut = True
    driving.ms(600)
    assert driving.adapter.state == "lost"
    driving.to_adapter.cut = False
    lost_at = driving.events[-1][0]
    driving.ms(5_000)
    assert set(names(driving, lost_at)) == {"STOP", "VEL", "RVEL", "CLOSE"}
    assert names(driving, lost_at).count("STOP") == 1 + 3
    assert driving.robot.forward == 0
    driving.pins.set("p2dx_con", False, driving.now)
    driving.ms(20)
    assert driving.adapter.state == "idle"
    driving.pins.set("p2dx_con", True, driving.now)
    driving.ms(1_500)
    assert driving.adapter.state == "driving"
    assert driving.robot.forward == 188


def test_a_reset_notice_of_the_robot_is_a_loss(driving: Rig) -> None:
    driving.adapter.receive(bytes.fromhex("fafb03ff00ff"), driving.now)
    assert driving.adapter.state == "lost"
    assert "reset" in driving.adapter.status.reason


def test_other_packets_do_not_stand_in_for_a_sip(driving: Rig) -> None:
    driving.robot.sends = False
    driving.ms(50)
    lost_at = driving.adapter._agenda.sip_deadline
    while driving.now < lost_at:
        driving.adapter.receive(bytes.fromhex("fafb06b0900001b091"), driving.now)
        driving.run(min(driving.now + 50 * MS, lost_at - 1))
        assert driving.adapter.state == "driving"
        driving.run(driving.now + 1)
    assert driving.adapter.state == "lost"
    assert "no SIP in time" in driving.adapter.status.reason


def test_a_sip_after_the_loss_is_not_taken(driving: Rig) -> None:
    driving.robot.obeys = False
    driving.pins.motors(3, 3, driving.now)
    driving.ms(1_500)
    sips = driving.adapter.status.sips
    driving.adapter.receive(driving.to_adapter.log[-1][1], driving.now)
    assert (driving.adapter.state, driving.adapter.status.sips) == ("lost", sips)


def test_four_motor_bits_command_finer_steps() -> None:
    rig = Rig(AdapterSettings(threshold_um=600_000, step_um_per_s=31_250), pinout=parse_pinout(four_bits()))
    rig.connect()
    rig.pins.motors(7, -8, rig.now, width=4)
    rig.ms(200)
    assert rig.adapter.status.motors == (7, -8)
    # (7 − 8) × 31.25 / 2 = −15.6 mm/s; −15 × 31.25 / 357 rad/s = −75.2 deg/s
    assert (rig.robot.forward, rig.robot.turn) == (-16, -75)


def test_an_adapter_without_a_listener_works_alike(driving: Rig) -> None:
    driving.adapter.on_event = None
    driving.pins.motors(2, 2, driving.now)
    driving.ms(200)
    assert driving.robot.forward == 125
    assert driving.adapter.outputs.levels == driving.pins.outputs


def test_distances_follow_the_sonar_at_the_threshold(driving: Rig) -> None:
    # 600 000 µm / 268 µm = 2238.8 counts: 2238 is nearer, 2239 is not.
    driving.robot.sip = replace(
        driving.robot.sip,
        sonar=(*(SonarReading(number, 2238 + number % 2) for number in range(8)), SonarReading(12, 0)),
    )
    driving.ms(150)
    assert driving.pins.distances() == "10101010"
    assert driving.adapter.status.ranges_um[:2] == (2238 * 268, 2239 * 268)


def test_encoders_follow_the_wheels_one_code_at_a_time(driving: Rig) -> None:
    codes = []
    for step in range(1, 12):
        driving.robot.sip = replace(driving.robot.sip, raw_x=step * 100)
        for _ in range(50):
            driving.ms(2)
            codes.append(driving.pins.code("encoder1"))
    jumps = {(after - before) % 8 for before, after in pairwise(codes)}
    assert jumps == {0, 1}
    # 1100 counts of 0.84 mm are 14.26 steps of 64.8 mm.
    assert driving.adapter.status.counts == (14, RIGHT_BEGINS + 14)
    assert codes[-1] == 14 % 8


@pytest.mark.parametrize(("at_open", "held", "code"), [(EncoderAtOpen.ZERO, 3, 0), (EncoderAtOpen.CONTINUE, 7, 7)])
def test_encoders_hold_while_lost_and_begin_as_set(at_open: EncoderAtOpen, held: int, code: int) -> None:
    rig = Rig(AdapterSettings(threshold_um=600_000, encoder_at_open=at_open))
    rig.connect()
    rig.robot.sip = replace(rig.robot.sip, raw_x=-380 & 0x7FFF)  # −4.93 steps: 5 less than 0, or than 4
    rig.ms(400)
    assert rig.pins.code("encoder2") == held
    rig.pins.set("p2dx_con", False, rig.now)
    rig.ms(300)
    assert rig.pins.code("encoder2") == held
    rig.pins.set("p2dx_con", True, rig.now)
    rig.ms(1_500)
    assert rig.adapter.state == "driving"
    assert rig.pins.code("encoder2") == code


@pytest.mark.parametrize("code", range(8))
def test_no_encoder_jumps_as_a_new_adapter_begins_to_drive_its_wires(code: int) -> None:
    idle = {f"encoder{side}_s{bit + 1}": bool(code >> bit & 1) for side in (1, 2) for bit in range(3)}
    wires = tuple(replace(wire, idle=idle.get(wire.name, wire.idle)) for wire in PINOUT.wires)
    pins = FakePins()
    adapter = Adapter(pins=pins, pinout=replace(PINOUT, wires=wires), parameters=PARAMETERS)
    adapter.advance_to(300 * MS)
    assert adapter.state == "idle"
    assert {name: pins.outputs[name] for name in idle} == idle
    assert adapter.status.counts == adapter.status.counts_shown == (code, code)


def test_a_robot_that_ignores_seto_is_driven_from_where_it_is() -> None:
    rig = Rig()
    rig.robot._obey = lambda _: None
    rig.robot.obeys = False
    rig.robot.sip = replace(rig.robot.sip, raw_x=777, raw_heading=55)
    rig.pins.set("p2dx_con", True, 0)
    rig.ms(700)
    assert rig.adapter.state == "settling"
    rig.ms(500)
    assert rig.adapter.state == "driving"
    assert rig.adapter.status.counts == (0, RIGHT_BEGINS)


def test_every_line_speed_is_tried_in_turn_up_to_the_eighth() -> None:
    bauds = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)
    adapter = Rig(AdapterSettings(threshold_um=600_000, bauds=bauds)).adapter
    adapter._enter(AdapterState.CONNECTING, 0, "connecting", "")
    tried = []
    for _ in range(len(bauds) + 1):
        tried.append(adapter.baud)
        adapter.session.take_events = lambda: [SessionEnded("no answer")]
        adapter._take_session_events(0)
    assert tried == [*bauds, bauds[0]]
    with pytest.raises(UsageError, match="bauds"):
        AdapterSettings(bauds=(*bauds, 1200))
    with pytest.raises(UsageError, match="bauds"):
        AdapterSettings(bauds=())


@pytest.mark.parametrize(("before_ns", "state"), [(1, "settling"), (0, "driving"), (-1, "driving")])
def test_odometry_that_is_not_zero_is_waited_for_until_its_time_is_over(before_ns: int, state: str) -> None:
    rig = Rig()
    rig.robot._obey = lambda _: None
    rig.robot.obeys = False
    rig.robot.sip = replace(rig.robot.sip, raw_x=777, raw_heading=55)
    rig.pins.set("p2dx_con", True, 0)
    rig.ms(700)
    rig.adapter._take_sip(rig.robot.sip, rig.adapter._agenda.settle_at - before_ns)
    assert rig.adapter.state == state


@pytest.mark.parametrize("moved", ["raw_x", "raw_y", "raw_heading"])
def test_any_count_that_is_not_zero_keeps_the_adapter_waiting(moved: str) -> None:
    rig = Rig()
    rig.robot._obey = lambda _: None
    rig.robot.obeys = False
    rig.robot.sip = replace(rig.robot.sip, **{moved: 1})
    rig.pins.set("p2dx_con", True, 0)
    rig.ms(700)
    assert rig.adapter.state == "settling"


def test_an_odometry_jump_is_reported_and_is_no_travel(driving: Rig) -> None:
    driving.robot.sip = replace(driving.robot.sip, raw_x=9_000)
    driving.ms(150)
    assert driving.events[-1][1] == "odometry jumped"
    assert driving.adapter.status.counts == (0, RIGHT_BEGINS)
    assert driving.adapter.status.odometry_jumps == 1


def test_a_stalled_robot_is_plausible_and_reported(driving: Rig) -> None:
    driving.robot.obeys = False
    driving.robot.sip = replace(driving.robot.sip, stall_left=True)
    driving.pins.motors(3, 3, driving.now)
    driving.ms(3_000)
    assert driving.adapter.state == "driving"
    assert ("stall", "left 1, right 0") in [event[1:] for event in driving.events]


@pytest.mark.parametrize("wire", ["p2dx_con", "rst"])
def test_what_the_sonar_said_is_forgotten_with_the_session(driving: Rig, wire: str) -> None:
    driving.ms(1)
    assert driving.adapter.status.ranges_um == (32_000 * 268,) * 8
    assert driving.adapter.status.distances == (False,) * 8
    driving.pins.set(wire, wire == "rst", driving.now)
    driving.ms(20)
    assert driving.adapter.state in {"closing", "reset"}
    assert driving.adapter.status.ranges_um == (None,) * 8
    assert driving.adapter.status.distances == (True,) * 8


def test_bit_zero_of_the_flags_is_not_a_motor_flag(driving: Rig) -> None:
    driving.robot.sip = replace(driving.robot.sip, raw_flags=0)
    driving.pins.motors(2, 2, driving.now)
    driving.ms(1_500)
    assert driving.adapter.state == "driving"


def test_rst_wipes_all_but_the_encoders_and_releases_the_outputs(driving: Rig) -> None:
    driving.robot.sip = replace(driving.robot.sip, raw_x=9_000)
    driving.ms(100)
    driving.robot.sip = replace(driving.robot.sip, raw_x=9_200)
    driving.pins.motors(2, 1, driving.now)
    driving.ms(200)
    status = driving.adapter.status
    assert (status.motors, status.speeds, status.odometry_jumps) == ((2, 1), CommandedSpeeds(94, -10), 1)
    driving.pins.motors(0, 0, driving.now)
    driving.pins.set("rst", True, driving.now)
    driving.ms(2)
    status = driving.adapter.status
    assert (status.state, status.motors, status.speeds) == ("reset", (0, 0), CommandedSpeeds(0, 0))
    assert (status.sips, status.odometry_jumps) == (0, 0)
    assert set(driving.pins.outputs.values()) == {None}
    since = driving.now
    driving.ms(1_000)
    assert driving.sent(since) == []
    driving.pins.set("rst", False, driving.now)
    driving.ms(1_600)
    # p2dx_con is high still: the first frame of the new life is STOP.
    assert names(driving, since)[:7] == ["STOP", "VEL", "RVEL", "STOP", "VEL", "RVEL", "PULSE"]
    assert driving.adapter.state == "driving"
    assert driving.pins.code("encoder1") == 2


def test_the_encoders_are_absolute_over_a_reset_of_the_adapter(driving: Rig) -> None:
    driving.robot.sip = replace(driving.robot.sip, raw_x=200)  # 2.59 steps of 64.8 mm
    driving.ms(400)
    driving.pins.set("rst", True, driving.now)
    driving.ms(20)
    driving.pins.set("rst", False, driving.now)
    driving.ms(310)
    assert driving.pins.code("encoder1") == 2
    driving.ms(1_600)
    driving.robot.sip = replace(driving.robot.sip, raw_x=60)  # 0.78 steps more
    driving.ms(400)
    assert driving.pins.code("encoder1") == 3


def test_the_encoders_are_absolute_while_the_bluepill_is_reset(driving: Rig) -> None:
    driving.robot.sip = replace(driving.robot.sip, raw_x=200)
    driving.ms(400)
    for name in ("p2dx_con", "motor1_comm1", "motor2_comm1"):
        driving.pins.set(name, False, driving.now)
    driving.ms(2_000)
    assert driving.pins.code("encoder1") == 2
    driving.pins.set("p2dx_con", True, driving.now)
    driving.ms(1_600)
    assert (driving.adapter.state, driving.pins.code("encoder1")) == ("driving", 2)


def test_rst_while_booting_begins_the_boot_anew(rig: Rig) -> None:
    rig.ms(200)
    rig.pins.set("rst", True, rig.now)
    rig.ms(4)
    rig.pins.set("rst", False, rig.now)
    rig.ms(298)
    assert rig.adapter.state == "booting"
    rig.ms(4)
    assert rig.adapter.state == "idle"


def test_bytes_are_not_taken_before_the_boot_is_over(rig: Rig) -> None:
    rig.adapter.receive(StandardSip().to_frame(FakeRobot().connection.settings.profile).to_bytes(), 0)
    assert rig.adapter.session.stats.frames_received == 0


def test_p2dx_con_low_while_connecting_gives_up(rig: Rig) -> None:
    rig.to_robot.cut = True
    rig.pins.set("p2dx_con", True, 0)
    rig.ms(500)
    assert rig.adapter.state == "connecting"
    rig.pins.set("p2dx_con", False, rig.now)
    rig.ms(15)
    assert rig.adapter.state == "closing"


def test_rejected_frames_are_counted(driving: Rig) -> None:
    driving.adapter.receive(bytes.fromhex("fafb060b3bc800d300"), driving.now)
    assert driving.adapter.session.stats.wire.bad_checksums == 1


def test_linear_and_angular_reach_the_wire() -> None:
    rig = Rig(AdapterSettings(threshold_um=600_000, motor_meaning="linear_angular", bit_order="comm1_msb"))
    rig.connect()
    rig.pins.set("motor1_comm3", True, rig.now)  # weighs 1 here: 62.5 mm/s, rounded away from zero
    rig.pins.set("motor2_comm2", True, rig.now)  # weighs 2: 0.85 rad/s
    rig.ms(200)
    assert rig.adapter.status.motors == (1, 2)
    assert (rig.robot.forward, rig.robot.turn) == (63, 49)


def test_a_default_adapter_takes_half_the_sonar_range() -> None:
    adapter = Adapter(pins=FakePins(), pinout=PINOUT, parameters=PARAMETERS)
    assert adapter.distances.threshold_um == 2_500_000


@pytest.mark.parametrize("at_ms", [100, 317, 325, 400, 600, 700, 1_011, 1_205, 1_411, 1_500, 1_900, 2_050])
def test_a_snapshot_taken_anywhere_continues_alike(at_ms: int) -> None:
    whole = Rig()
    whole.pins.set("p2dx_con", True, 310 * MS)
    for at, left, right in ((900, 2, 2), (1_003, -4, 3), (1_009, 0, 0), (1_013, 1, 1)):
        whole.pins.motors(left, right, at * MS)
    whole.pins.set("p2dx_con", False, 1_400 * MS)
    whole.pins.set("rst", True, 1_800 * MS)
    whole.pins.set("rst", False, 2_000 * MS)
    whole.run(at_ms * MS)
    copy = Rig()
    copy.now = whole.now
    copy.robot, copy.to_robot, copy.to_adapter = deepcopy((whole.robot, whole.to_robot, whole.to_adapter))
    copy.pins.history, copy.pins.outputs = whole.pins.history, dict(whole.pins.outputs)
    copy.adapter.restore(pickle.loads(pickle.dumps(whole.adapter.snapshot())))  # noqa: S301  # our own bytes
    count = len(whole.events)
    for rig in (whole, copy):
        rig.run(2_500 * MS)
    assert copy.events == whole.events[count:]
    assert copy.to_robot.log == whole.to_robot.log
    assert copy.pins.outputs == whole.pins.outputs
    assert copy.adapter.status == whole.adapter.status


def test_a_snapshot_is_no_alias_of_what_lives(driving: Rig) -> None:
    saved = driving.adapter.snapshot()
    before = pickle.dumps(saved)
    driving.pins.motors(2, -2, driving.now)
    driving.robot.sip = replace(driving.robot.sip, raw_x=200)
    driving.ms(700)
    assert pickle.dumps(saved) == before
