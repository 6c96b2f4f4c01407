"""Sonar arrays, bumper segments, infra-red eyes, and outputs that are held for a time."""

import math
from typing import Any

import pytest

from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer, SonarPerSip
from p2os.pioneer.controller.flash import FlashParameters
from p2os.pioneer.sonar.schedule import SonarSchedule
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.config_packet import NUMBERS, ConfigPacket
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.packets import IoPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS
from tests.p2os.pioneer.body.bodies import each_body

ARRAYS = {1: range(8), 2: range(8, 16), 3: range(16, 24), 4: range(24, 32)}


def fired(robot: Any) -> set[int]:
    robot.run(300)
    robot.frames()
    robot.run(100)
    (sip,) = robot.sips()
    return {reading.number for reading in sip.sonar}


def peoplebot(make_robot: Any, profile: Profile = Profile.ARCOS) -> Any:
    return make_robot(parameters=load_parameters("perfpb"), profile=profile, sonar_per_sip=SonarPerSip.ALL).open()


@pytest.mark.parametrize("profile", [Profile.AROS, Profile.ARCOS])
@pytest.mark.parametrize("array", ARRAYS)
def test_one_array_is_switched_by_its_number_and_bit_0(make_robot: Any, array: int, profile: Profile) -> None:
    robot = peoplebot(make_robot, profile)
    robot.say(C.SONAR, array << 1)
    assert fired(robot) == set(range(32)) - set(ARRAYS[array])
    assert robot.sip().raw_flags >> 1 & 0xF == 0xF & ~(1 << array - 1)
    robot.say(C.SONAR, 0)
    assert fired(robot) == set()
    robot.say(C.SONAR, array << 1 | 1)
    assert fired(robot) == set(ARRAYS[array])
    assert robot.sip().raw_flags >> 1 & 0xF == 1 << array - 1
    robot.say(C.SONAR, 1)
    assert fired(robot) == set(range(32))


def test_an_array_that_is_not_fitted_is_reported_and_nothing_changes(make_robot: Any) -> None:
    robot = make_robot(profile=Profile.ARCOS, sonar_per_sip=SonarPerSip.ALL).open()
    robot.say(C.SONAR, 4)
    assert ("no such sonar", "array 2") in [(what, detail) for _, what, detail in robot.events]
    assert fired(robot) == set(range(8))
    assert robot.sip().raw_flags >> 1 & 0xF == 1


def test_a_p2os_robot_knows_no_arrays(make_robot: Any) -> None:
    robot = peoplebot(make_robot, Profile.P2OS)
    robot.say(C.SONAR, 0)
    robot.say(C.SONAR, 4)
    assert fired(robot) == set(range(32))


def test_sonar_beyond_the_fourth_array_go_with_it() -> None:
    bank = SonarSchedule(40, pings_per_cycle=None, cycle_ns=100 * NS_PER_MS)
    for is_on, fired in ((False, 24), (True, 40)):
        bank.switch(on=is_on, now=0, array=4)
        ping = bank.next_ping()
        assert ping is not None
        assert ping.numbers == tuple(range(fired))


def test_polling_and_arrays_go_together(make_robot: Any) -> None:
    robot = make_robot(parameters=load_parameters("perfpb"), profile=Profile.ARCOS).open()
    robot.say(C.POLLING, bytes((1, 9, 10)))
    robot.say(C.SONAR, 2)
    assert fired(robot) == {8, 9}
    robot.say(C.SONAR, 4)
    assert fired(robot) == set()
    robot.say(C.SONAR, 3)
    assert fired(robot) == {0}


ROOM = parse_world(
    'name = "r"\nextent_m = [-4, -4, 4, 4]\n'
    '[[box]]\nname = "ahead"\nx_m = 1.5\ny_m = 0.0\nlength_m = 0.2\nwidth_m = 3.0\nheight_m = 1.5\n'
    '[[box]]\nname = "behind"\nx_m = -1.5\ny_m = 0.0\nlength_m = 0.2\nwidth_m = 3.0\nheight_m = 1.5\n',
    "r",
)


class Driver:
    """A PeopleBot that is driven against something, and its packets."""

    def __init__(self, body: str, heading_deg: float = 0.0, x_m: float = 0.0, **flash: int) -> None:
        self.parameters = load_parameters("perfpb")
        settings = ControllerSettings(profile=Profile.ARCOS, flash=FlashParameters().with_values(flash))
        made = make_body(body, ROOM, self.parameters)
        made.reset(Pose(x_m, 0.0, math.radians(heading_deg)), 0)
        self.robot = Pioneer(parameters=self.parameters, body=made, settings=settings)
        self.now, self.decoder = 0, Decoder()
        for number in (C.PULSE, C.OPEN, C.CLOSE, C.OPEN):
            self.say(number)
        self.say(C.ENABLE, 1)

    def say(self, number: int, argument: int | None = None) -> None:
        self.robot.receive(Command(number, argument).to_frame().to_bytes(), self.now)

    def packets(self, milliseconds: int) -> list[Frame]:
        for _ in range(milliseconds // 500):
            self.say(C.PULSE)
            self.now += 500 * NS_PER_MS
            self.robot.advance_to(self.now)
        for data in self.robot.take_output():
            self.decoder.receive(data, self.now)
        found = []
        while (item := self.decoder.next_item()) is not None:
            assert isinstance(item, Frame)
            found.append(item)
        return found

    def bumpers(self, milliseconds: int = 3000) -> set[tuple[int, int]]:
        packets = [frame for frame in self.packets(milliseconds) if frame.kind in SIP_KINDS]
        sips = [StandardSip.from_frame(frame, Profile.ARCOS) for frame in packets]
        return {(sip.front_bumpers, sip.rear_bumpers) for sip in sips if sip.front_bumpers or sip.rear_bumpers}


@pytest.mark.parametrize("body", each_body())
@pytest.mark.parametrize(
    ("heading_deg", "speed", "front", "rear"),
    # A corner of the hull meets the wall first, at 43 degrees from ahead or 34 from behind. Segment 1 is at the left
    # end in front and, clockwise, at the right end behind; each is 27 degrees wide.
    [(20.0, 300, 0b11000, 0), (-20.0, 300, 0b00011, 0), (20.0, -300, 0, 0b11000), (-20.0, -300, 0, 0b00011)],
)
def test_the_segment_is_pressed_where_the_hull_is_touched(
    body: str, heading_deg: float, speed: int, front: int, rear: int
) -> None:
    driver = Driver(body, heading_deg, math.copysign(0.7, speed))
    driver.say(C.VEL, speed)
    seen = driver.bumpers()
    assert any(pair[0] & front or pair[1] & rear for pair in seen), seen
    assert all((pair[0] > 0, pair[1] > 0) == (front > 0, rear > 0) for pair in seen), seen


def test_bumpers_are_those_of_the_model_unless_the_flash_has_others(make_robot: Any) -> None:
    def config(**flash: int) -> tuple[int, int]:
        robot = make_robot(
            parameters=load_parameters("powerbot"), profile=Profile.ARCOS, flash=FlashParameters().with_values(flash)
        ).open()
        robot.say(C.CONFIG)
        (packet,) = [ConfigPacket.from_frame(frame) for frame in robot.frames() if frame.kind == 0x20]
        return packet.frontbumps, packet.rearbumps

    assert config() == (7, 5)
    assert config(frontbumps=0, rearbumps=3) == (0, 3)


@pytest.mark.parametrize("body", each_body())
def test_an_eye_sees_what_is_as_near_as_it_looks(body: str) -> None:
    driver = Driver(body, 35.0)  # eye 0 is at -35 degrees: it looks at the wall
    driver.say(C.IOREQUEST, 1)
    (packet,) = [IoPacket.from_frame(frame) for frame in driver.packets(500) if frame.kind == IoPacket.KIND]
    assert packet.digital_in[3] == 0xFF
    for number, (x_mm, y_mm) in enumerate(driver.parameters.infrared[:2]):  # each in turn looks at the wall
        driver.robot.body.stand_at(1.0, 0.0, -math.atan2(y_mm, x_mm))
        driver.say(C.IOREQUEST, 1)
        (packet,) = [IoPacket.from_frame(frame) for frame in driver.packets(500) if frame.kind == IoPacket.KIND]
        assert packet.digital_in[3] == 0xFF ^ 1 << number


def test_a_kick_holds_the_first_output_for_its_time(make_robot: Any) -> None:
    robot = make_robot(profile=Profile.ARCOS).open()
    robot.say(C.KICK, 250)
    assert [robot.sip().digital_out & 1 for _ in range(4)] == [1, 1, 0, 0]


def test_what_a_number_does_that_no_manual_explains_is_nothing_on_p2os_alone(make_robot: Any) -> None:
    for profile, ignored in ((Profile.P2OS, 0), (Profile.AROS, 1)):
        robot = make_robot(profile=profile).open()
        robot.say(C.SETPBV, 3)
        assert robot.pioneer.state.ignored_commands == ignored


def test_the_words_of_the_flash_that_have_a_sign_are_those_that_aria_reads_so(make_robot: Any) -> None:
    assert {name for name, (least, _) in NUMBERS.items() if least < 0} == {"driftfactor", "hightemp", "gyrofw"}
    robot = make_robot(profile=Profile.ARCOS).open()
    robot.say(C.DRIFTFACTOR, -20)
    robot.say(C.REVCOUNT, 40_000)
    robot.say(C.CONFIG)
    (packet,) = [ConfigPacket.from_frame(frame) for frame in robot.frames() if frame.kind == 0x20]
    assert (packet.driftfactor, packet.revcount) == (-20, 40_000)
