"""The verbs ports, doctor and info."""

import json
from collections.abc import Callable

import pytest

from p2os.cli import doctor
from p2os.cli.links import ports
from p2os.cli.main import run
from p2os.cli.robots import info
from p2os.client.observer import Observer
from p2os.pioneer.controller.commands import CommandEffect
from p2os.pioneer.serve import served_pioneer
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.packets import Identity
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from p2os.transport.virtual_clock import VirtualClock

P2DX = load_parameters("p2dx")
Capture = pytest.CaptureFixture[str]

# ports ----------------------------------------------------------------------------------

TWO_PORTS = [
    {"url": "serial:/dev/ttyS0", "description": "n/a", "hardware": "n/a"},
    {"url": "serial:/dev/ttyUSB0", "description": "USB Serial", "hardware": "USB VID:PID=1A86:7523"},
]


def test_ports_are_listed_as_urls(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(ports, "list_serial_ports", lambda: TWO_PORTS)
    assert run(["ports"]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [
        "serial:/dev/ttyS0",
        "                     a port of the machine itself: a robot may be on it, if it is wired at all",
        "serial:/dev/ttyUSB0  USB Serial, USB VID:PID=1A86:7523",
        "                     CH340 adapter, also on ESP32 boards: a robot or the adapter board may be behind it",
    ]
    assert captured.err == "2 serial ports\nhint: p2os scan asks them who is there\n"


def test_no_ports_is_a_result_with_a_hint(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(ports, "list_serial_ports", list)
    assert run(["ports"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("no serial ports\nhint: ")
    monkeypatch.setattr(ports, "list_serial_ports", lambda: TWO_PORTS[:1])
    run(["ports"])
    assert capsys.readouterr().err.startswith("1 serial port\n")


def test_ports_are_listed_for_programs(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(ports, "list_serial_ports", lambda: TWO_PORTS)
    assert run(["ports", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [{name: port[name] for name in TWO_PORTS[0]} for port in found] == TWO_PORTS
    assert all(port["guess"] for port in found)


# doctor ---------------------------------------------------------------------------------


def test_doctor_tells_what_is_there(capsys: Capture) -> None:
    assert run(["doctor"]) == 0
    captured = capsys.readouterr()
    assert "ok       pyserial " in captured.out
    assert " installed, " in captured.err
    assert run(["doctor", "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)
    assert {"python", "pyserial", "pybullet", "tshark"} <= {finding["name"] for finding in findings}


def test_doctor_tells_how_to_get_what_is_missing() -> None:
    findings = {finding.name: finding for finding in doctor.examine(find_program=lambda _name: None)}
    program = findings["tshark"]
    assert program.found is None
    assert "missing  tshark" in doctor.line_of(program)
    assert "get it: sudo apt-get install tshark" in doctor.line_of(program)


def test_the_columns_of_doctor_hold_every_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "find_spec", lambda _name: object())
    rows = [doctor.line_of(finding) for finding in doctor.examine(find_program=lambda name: f"/usr/bin/{name}")]
    found = [row.splitlines()[0] for row in rows if row.startswith("ok")]
    assert {row[27:29] for row in found} == {"  "}, rows
    assert {row[60:62] for row in found} == {"  "}
    assert not {row[29] for row in found} & {" "}


def test_doctor_tells_what_was_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctor.built_part("p2os.transport") == "built"
    assert doctor.built_part("p2os.no_such_part") is None
    assert doctor.built_part("no_such_package.part") is None
    monkeypatch.setattr(doctor, "find_spec", lambda _name: object())
    assert doctor.built_part("bluepill_sim._native") == "built"


def test_doctor_knows_which_pythons_have_no_bullet() -> None:
    findings = {finding.name: finding for finding in doctor.examine(python=(3, 13))}
    assert findings["pybullet"].get == 'pybullet needs python_version < "3.12"'
    assert "install numpy" in findings["numpy"].get
    findings = {finding.name: finding for finding in doctor.examine(python=(3, 10))}
    assert findings["python"].found is None


def test_doctor_fails_when_something_is_missing_that_all_verbs_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "package_version", lambda name: None if name == "pyserial" else "1.0")
    assert run(["doctor"]) == 1
    monkeypatch.setattr(doctor, "package_version", lambda name: None if name == "unicorn" else "1.0")
    assert run(["doctor"]) == 0


def test_a_package_that_is_not_there_has_no_version() -> None:
    assert doctor.package_version("no-such-package-at-all") is None


# info -----------------------------------------------------------------------------------


def test_a_robot_tells_who_it_is_and_is_left_closed(clock: VirtualClock) -> None:
    told: list[str] = []
    note = lambda _now, what, _detail: told.append(what)  # noqa: E731
    with served_pioneer(body="kinematic", on_event=note, clock=clock) as url:
        found = info.ask(url)
    assert found.identity == Identity("Virtual", "Pioneer", "p2dx")
    assert found.config is not None
    assert found.state.battery_v == 12.6
    assert found.state.sonar
    assert "motors" not in told
    assert told.index("opened") < told.index("closed")


def test_a_robot_that_knows_no_config_still_answers(monkeypatch: pytest.MonkeyPatch, clock: VirtualClock) -> None:
    monkeypatch.setattr("p2os.pioneer.controller.controller.apply", lambda *_: CommandEffect.UNKNOWN)
    with served_pioneer(body="kinematic", clock=clock) as url:
        assert info.ask(url).config is None


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let `p2os info` find a robot that says this."""

    def tell(identity: Identity, sip: StandardSip, config: ConfigPacket | None) -> None:
        found = info.RobotInfo(identity=identity, state=Observer(P2DX).take(sip, 0), parameters=P2DX, config=config)
        monkeypatch.setattr(info, "ask", lambda _url: found)

    return tell


SIP = StandardSip(
    raw_x=32767, raw_y=1000, raw_heading=1024, raw_left_velocity=100, raw_right_velocity=-100, raw_battery=130,
    stall_left=True, stall_right=True, sonar=(SonarReading(3, 1000),),
)  # fmt: skip


def test_info_is_printed_with_units(told: Callable[..., None], capsys: Capture) -> None:
    told(Identity("", "Pioneer", "p2dx"), SIP, ConfigPacket(subclass="p2dx", watchdog=2000, fields_sent=19))
    assert run(["info", "tcp:x"]) == 0
    out = capsys.readouterr().out
    for line in (
        "name      (none)",
        "model     p2dx (Pioneer 2-DX)",
        "position  x -0.001 m, y 0.840 m, heading 90.0 deg",
        "wheels    left 0.100 m/s, right -0.100 m/s",
        "stalled   left and right",
        "battery   13.0 V",
        "sonar     3: 0.268 m",
        "config    watchdog          2000 ms",
    ):
        assert f"{line}\n" in out
    assert "stallval" not in out, "fields that were not sent are not shown"


def test_info_of_an_unknown_model_says_whose_units_it_uses(told: Callable[..., None], capsys: Capture) -> None:
    told(Identity("Box", "Pioneer", "box9000"), StandardSip(), None)
    assert run(["info", "tcp:x"]) == 0
    out = capsys.readouterr().out
    assert "model     box9000 (unknown model, units of a Pioneer 2-DX)\n" in out
    assert "sonar     off\n" in out
    assert "stalled   none\n" in out
    assert "config    the robot does not send it\n" in out


def test_info_is_printed_for_programs(told: Callable[..., None], capsys: Capture) -> None:
    told(Identity("Wilma", "Pioneer", "p2dx"), SIP, ConfigPacket(subclass="p2dx", fields_sent=3))
    assert run(["info", "tcp:x", "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert plain["name"] == "Wilma"
    assert plain["sip"]["x_m"] == -0.00084
    assert plain["sip"]["sonar_m"] == {"3": 0.268}
    assert plain["config"] == {"robot_class": "Pioneer", "subclass": "p2dx", "serial": ""}
    told(Identity("Wilma", "Pioneer", "p2dx"), SIP, None)
    assert run(["info", "tcp:x", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["config"] is None
