"""One tick before and at each deadline of the adapter."""

from dataclasses import replace
from itertools import pairwise

import pytest

from adapter_sim import AdapterSettings
from adapter_sim.driver import CommandPacer, SpeedPlausibility
from adapter_sim.mixing import CommandedSpeeds
from adapter_sim.pins import Debounce, Majority
from adapter_sim.receiver import Receiver
from p2os.protocol.commands import CommandNumber
from p2os.protocol.frames import Frame
from p2os.protocol.sip import SonarReading
from tests.adapter_sim.conftest import CHARACTER_NS, MS, FakePins, FakeRobot, Rig


def test_p2dx_con_counts_as_high_after_more_than_ten_milliseconds() -> None:
    level = Debounce(10 * MS, 10 * MS)
    assert not level.take(True, 0)
    assert not level.take(True, 10 * MS)  # ten, not more
    assert level.take(True, 10 * MS + 1)


def test_p2dx_con_counts_as_low_after_ten_milliseconds() -> None:
    level = Debounce(10 * MS, 10 * MS)
    level.take(True, 0)
    level.take(True, 11 * MS)
    assert not level.take(False, 20 * MS)
    assert not level.take(False, 30 * MS - 1)
    assert level.take(False, 30 * MS)


def test_a_dip_starts_the_ten_milliseconds_anew() -> None:
    level = Debounce(10 * MS, 10 * MS)
    for at, raw in ((0, True), (8, True), (10, False), (12, True), (22, True)):
        assert not level.take(raw, at * MS)
    assert level.take(True, 24 * MS)


def test_after_a_reset_high_has_to_last_anew() -> None:
    level = Debounce(10 * MS, 10 * MS)
    level.take(True, 0)
    level.take(True, 11 * MS)
    level.reset()
    assert not level.level
    assert not level.take(True, 12 * MS)
    assert not level.take(True, 22 * MS)
    assert level.take(True, 22 * MS + 1)


def test_a_word_is_taken_at_its_third_sample_of_five() -> None:
    window = Majority(5)
    assert [window.take((6,)) for _ in range(4)] == [False, False, True, False]
    assert window.taken == (6,)


def test_two_samples_of_a_glitch_pass_without_effect() -> None:
    window = Majority(5)
    for word in (6, 6, 0, 0, 0, 6, 6, 0, 0, 0):
        window.take((word,))
        assert window.taken == (0,)


def test_no_majority_keeps_the_last_word() -> None:
    window = Majority(5)
    for word in (1, 2, 3, 4, 5, 6, 7, 1, 2, 3):
        assert not window.take((word,))


@pytest.mark.parametrize(("high_ms", "connects"), [(10, False), (12, False), (14, True)])
def test_a_pulse_on_p2dx_con_must_last(rig: Rig, high_ms: int, connects: bool) -> None:
    rig.ms(400)
    # Seen first at the next sample, 2 ms on; at 12 ms its samples span 10 ms, at 14 ms they span 12.
    rig.pins.set("p2dx_con", True, rig.now + 1)
    rig.pins.set("p2dx_con", False, rig.now + 1 + high_ms * MS)
    rig.ms(50)
    assert [what for _, what, _ in rig.events if what == "connecting"] == ["connecting"] * connects


def test_the_adapter_boots_300_ms_after_rst_falls(rig: Rig) -> None:
    rig.pins.set("rst", True, 0)
    rig.run(1_000 * MS - 1)
    assert (rig.adapter.state, rig.pins.outputs) == ("reset", {})
    rig.pins.set("rst", False, 1_000 * MS)
    rig.run(1_300 * MS - 1)
    assert rig.adapter.state == "booting"
    rig.run(1_300 * MS)
    assert rig.adapter.state == "idle"
    assert rig.pins.distances() == "11111111"
    assert (rig.pins.code("encoder1"), rig.pins.code("encoder2")) == (0, 4), "as the wires' pulls"


def test_a_changed_pair_goes_out_at_once_or_at_the_spacing() -> None:
    pacer = CommandPacer(spacing_ns=25 * MS, refresh_ns=200 * MS)
    pacer.begin(CommandedSpeeds(1, 0))
    assert pacer.due_at(7) == 7
    pacer.take(1_000)
    pacer.wanted = CommandedSpeeds(2, 0)
    assert pacer.due_at(2_000) == 1_000 + 25 * MS
    pacer.wanted = CommandedSpeeds(3, 0)
    assert pacer.take(1_000 + 25 * MS) == CommandedSpeeds(3, 0)  # the latest only
    assert pacer.due_at(1_000 + 26 * MS) == 1_000 + 225 * MS


def pairs(rig: Rig, since: int) -> list[tuple[int, object, object]]:
    sent = rig.sent(since)
    return [(at, argument, sent[index + 1][2]) for index, (at, name, argument) in enumerate(sent[:-1]) if name == "VEL"]


def test_speeds_go_out_on_change_and_every_200_ms(driving: Rig) -> None:
    start = driving.now
    driving.pins.motors(2, 2, start)
    driving.ms(700)
    times = [at for at, forward, _ in pairs(driving, start) if forward == 125]
    # The third sample after the edge, at most 3 × 2 ms.
    assert start < times[0] <= start + 6 * MS
    assert [after - before for before, after in pairwise(times)] == [200 * MS] * 3


def test_at_most_one_pair_every_25_ms_and_the_latest_only(driving: Rig) -> None:
    start = driving.now
    for index in range(50):
        driving.pins.motors(index % 7 - 3, 0, start + index * 8 * MS)
    driving.ms(600)
    sent = pairs(driving, start)
    gaps = [after[0] - before[0] for before, after in pairwise(sent)]
    assert min(gaps) == 25 * MS
    assert len(sent) <= 600 // 25 + 1
    assert sent[-1][1:] == (-94, 30)  # 49 % 7 − 3 = −3: −93.75 mm/s, 30.1 deg/s


def last_sip_at(rig: Rig) -> int:
    """Return when the last SIP that was sent arrives."""
    at, frame = rig.to_adapter.log[-1]
    return max(at, rig.to_adapter.free_at - len(frame) * CHARACTER_NS) + len(frame) * CHARACTER_NS


def test_350_ms_without_a_sip_is_a_loss_and_stop_goes_first(driving: Rig) -> None:
    driving.pins.motors(3, 3, driving.now)
    driving.ms(300)
    driving.robot.sends = False
    lost_at = last_sip_at(driving) + 350 * MS
    driving.run(lost_at - 1)
    assert driving.adapter.state == "driving"
    driving.run(lost_at)
    assert driving.adapter.state == "lost"
    stopping = [name for at, name, _ in driving.sent(lost_at)]
    assert stopping == ["STOP", "VEL", "RVEL", "CLOSE"]
    assert driving.pins.distances() == "11111111"
    assert "no packet for 350 ms" in driving.adapter.status.reason


def test_what_is_implausible_is_reported_wheel_by_wheel() -> None:
    check = SpeedPlausibility(timeout_ns=1_500 * MS, tolerance_mm_s=40, progress_mm_s=5)
    check.measured, check.command = (1, 2), (300, 400)
    assert check.describe() == "wheels at 1 and 2 mm/s for 1.5 s, commanded 300 and 400, and no stall flag"


def test_one_second_of_wheels_that_do_not_follow_is_implausible(driving: Rig) -> None:
    driving.robot.obeys = False
    driving.pins.motors(3, 3, driving.now)
    driving.ms(2_000)
    at, what, why = driving.events[-1]
    assert what == "implausible"
    assert "wheels at 0 and 0 mm/s for 1.0 s, commanded 188 and 188" in why
    assert [name for _, name, _ in driving.sent(at)][:4] == ["STOP", "VEL", "RVEL", "CLOSE"]


@pytest.mark.parametrize(
    ("sip_after", "reported"), [(0, "lost"), (1, "implausible"), (-1, "lost")], ids=["both", "plausibility", "SIP"]
)
def test_no_sip_in_time_is_told_before_wheels_that_do_not_follow(driving: Rig, sip_after: int, reported: str) -> None:
    ends_at = driving.adapter._driver.plausibility.ends_at
    driving.adapter._agenda.sip_deadline = ends_at + sip_after
    driving.adapter._run_open(ends_at)
    assert driving.events[-1][1] == reported


@pytest.mark.parametrize(("early", "is_lost"), [(1, False), (0, True)])
@pytest.mark.parametrize("which", ["SIP", "plausibility"])
def test_a_loss_comes_at_its_deadline_and_not_one_before(driving: Rig, which: str, early: int, is_lost: bool) -> None:
    agenda, plausibility = driving.adapter._agenda, driving.adapter._driver.plausibility
    if which == "SIP":
        plausibility._passed_at = 10**15
        now = agenda.sip_deadline - early
    else:
        agenda.sip_deadline = 10**15
        now = plausibility.ends_at - early
    driving.adapter._run_open(now)
    assert (driving.adapter.state == "lost") is is_lost


def doubt() -> SpeedPlausibility:
    plausibility = SpeedPlausibility(timeout_ns=1_000, tolerance_mm_s=40, progress_mm_s=5)
    plausibility.begin(0)
    plausibility.take(0, 0, stalled=False, now=0)
    plausibility.expect(200, 200)
    return plausibility


def test_the_timeout_runs_from_the_last_plausible_packet() -> None:
    plausibility = doubt()
    plausibility.take(0, 0, stalled=False, now=900)
    assert plausibility.ends_at == 1_000


@pytest.mark.parametrize(("near", "ends_at"), [(161, 300), (160, 300), (159, 100), (240, 300), (241, 100)])
def test_wheels_that_leave_their_command_by_themselves_are_measured_on_their_way_back(near: int, ends_at: int) -> None:
    plausibility = doubt()
    plausibility.take(near, near, stalled=False, now=100)  # near is 40 or less from 200; further, it approaches
    plausibility.take(100, 100, stalled=False, now=200)
    assert plausibility.ends_at == 1_100
    plausibility.take(105, 105, stalled=False, now=300)
    assert plausibility.ends_at == 1_000 + ends_at


@pytest.mark.parametrize(
    ("speeds", "stalled", "ends_at"),
    [
        ((4, 4), False, 1_000),
        ((5, 5), False, 1_900),
        ((5, 0), False, 1_000),  # one wheel approaches, the other is dead
        ((160, 160), False, 1_900),
        ((0, 0), True, 1_900),
    ],
)
def test_plausibility_is_renewed_by_approach_nearness_or_stall(
    speeds: tuple[int, int], stalled: bool, ends_at: int
) -> None:
    plausibility = doubt()
    plausibility.take(*speeds, stalled=stalled, now=900)
    assert plausibility.ends_at == ends_at


def test_jitter_does_not_buy_time_for_ever() -> None:
    plausibility = doubt()
    for now in range(0, 5_000, 100):
        plausibility.take(now // 100 % 2 * 6, now // 100 % 2 * 6, stalled=False, now=now)
    assert plausibility.ends_at == 1_100


def test_a_new_command_buys_no_time() -> None:
    plausibility = doubt()
    for now in range(100, 900, 100):
        plausibility.expect(-200 if now % 200 else 200, 100)
        plausibility.take(0, 0, stalled=False, now=now)
    assert plausibility.ends_at == 1_000


def test_a_robot_knocked_off_its_speed_may_come_back_slowly() -> None:
    plausibility = doubt()
    plausibility.take(200, 200, stalled=False, now=100)
    for now, speed in ((900, 20), (1_000, 40), (1_800, 60)):
        plausibility.take(speed, speed, stalled=False, now=now)
    assert plausibility.ends_at == 2_800


def test_a_check_that_begins_anew_expects_wheels_at_rest() -> None:
    """A wheel runs on, and two packets come at once, before the first pair: progress is measured from the first."""
    plausibility = doubt()
    plausibility.begin(0)
    for speed in (50, 100):
        plausibility.take(speed, speed, stalled=False, now=0)
    plausibility.expect(0, 0)
    plausibility.take(46, 46, stalled=False, now=800)
    assert plausibility.ends_at == 1_000
    plausibility.take(45, 45, stalled=False, now=900)
    assert plausibility.ends_at == 1_900


def test_a_distance_is_an_obstacle_once_it_is_a_second_old(driving: Rig) -> None:
    driving.ms(150)
    assert driving.pins.distances() == "00000000"
    driving.robot.sip = replace(driving.robot.sip, sonar=(SonarReading(2, 32_000),))
    driving.ms(101)
    # The last full set arrived with the SIP before; its own age decides, to the nanosecond.
    deadline = driving.adapter.distances.expires_at
    assert deadline is not None
    driving.run(deadline - 1)
    assert driving.pins.distances() == "00000000"
    driving.run(deadline)
    assert driving.pins.distances() == "11011111"


def test_sonar_is_asked_for_again_when_no_reading_comes(driving: Rig) -> None:
    start = driving.now
    driving.robot.sip = replace(driving.robot.sip, sonar=())
    driving.ms(2_500)
    asked = [at for at, name, argument in driving.sent(start) if (name, argument) == ("SONAR", 1)]
    assert len(asked) == 2
    assert asked[1] - asked[0] == 1_000 * MS
    assert driving.pins.distances() == "11111111"


@pytest.mark.slow
def test_an_adapter_does_not_depend_on_how_time_is_sliced() -> None:
    traces = []
    for slice_ns in (1 * MS, 100_000, 7_777):
        rig = Rig(AdapterSettings(threshold_um=600_000), FakeRobot())
        rig.pins.set("p2dx_con", True, 310 * MS)
        for at, left, right in ((900, 2, 2), (1_103, -4, 3), (1_111, 0, 0), (1_113, 1, 1)):
            rig.pins.motors(left, right, at * MS + 123)
        rig.pins.set("p2dx_con", False, 1_200 * MS + 999)
        while rig.now < 1_300 * MS:
            rig.run(min(rig.now + slice_ns, 1_300 * MS))
        traces.append((rig.events, rig.to_robot.log, rig.pins.writes))
    assert traces[0] == traces[1] == traces[2]


def test_a_sample_reads_each_input_once_at_its_instant() -> None:
    class Instants(FakePins):
        def __init__(self) -> None:
            super().__init__()
            self.at: dict[int, list[str]] = {}

        def read(self, signal: str, at: int) -> bool:
            self.at.setdefault(at, []).append(signal)
            return super().read(signal, at)

    rig = Rig()
    pins = Instants()
    rig.adapter.inputs._pins = rig.adapter.inputs._motors._pins = pins
    rig.run(330 * MS)
    samples = {at: names for at, names in pins.at.items() if len(names) > 1}
    assert sorted(samples) == [at * MS for at in range(300, 331, 2)]
    assert all(len({name for name in names if name != "rst"}) == 7 for names in samples.values())


def stop_is_out_at(rig: Rig, since: int) -> int:
    """Return when the last byte of the first STOP since an instant has left, behind what was on the line before."""
    free_at = 0
    for at, data in rig.to_robot.log:
        free_at = max(at, free_at) + len(data) * CHARACTER_NS
        if at >= since and Frame.from_bytes(data).kind == CommandNumber.STOP:
            return free_at
    raise AssertionError("no STOP")


def busy(seed_ms: int) -> Rig:
    """Return a rig whose line is as full of speeds as it gets: the motor pins change at every sample."""
    rig = Rig(receiver=Receiver())
    rig.connect()
    for step in range(120):
        rig.pins.motors(step % 3 + 1, 3 - step % 3, rig.now + step * 8 * MS + seed_ms * MS)
    return rig


def test_stop_is_out_375_ms_after_the_last_sip_and_35_ms_after_p2dx_con_fell_however_full_the_line() -> None:
    silences, releases = [], []
    for phase_ms in range(0, 100, 3):
        rig = busy(phase_ms % 8)
        rig.ms(250 + phase_ms)
        rig.robot.sends = False
        silent_at = last_sip_at(rig)
        rig.ms(450)
        silences.append(stop_is_out_at(rig, silent_at) - silent_at)
        rig = busy(phase_ms % 8)
        rig.ms(250 + phase_ms)
        released_at = rig.now
        rig.pins.set("p2dx_con", False, released_at)
        rig.ms(100)
        releases.append(stop_is_out_at(rig, released_at) - released_at)
    # Seen in the next pass; 350 ms; a pair of 18.75 ms of the pass before that, and STOP's own 6.25 ms.
    assert 372 * MS < max(silences) <= 375 * MS, max(silences)
    # 10 ms of debouncing from the next sample on, and the same.
    assert 17 * MS < max(releases) <= 35 * MS, max(releases)
