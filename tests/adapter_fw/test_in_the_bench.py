"""The firmware core in the whole chain, in the model's place."""

from contextlib import nullcontext
from dataclasses import replace

import pytest

from adapter_sim import Adapter
from adapter_sim.encoders import HEADING_MODULUS
from adapter_sim.receiver import Receiver
from p2os import gamepad
from p2os.robots.parameters import load_parameters
from robot_bench.adapter import FirmwareAdapter, is_available, robot_numbers
from robot_bench.bench import Bench
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError
from simbase.timing import NS_PER_S
from tests.adapter_fw.twins import PINOUT, AdapterSettings, FakePins
from tests.adapter_sim.conftest import MS, Rig

PARAMETERS = load_parameters("p2dx")
pytestmark = pytest.mark.skipif(not is_available(), reason="the firmware core is not built: no C++17 compiler")


def scenario(core: str, name: str = "motors", duration_s: int = 8) -> Scenario:
    wanted = load_scenario(name).with_options(mode="adapter", body="kinematic", adapter_core=core)
    return replace(wanted, duration_ns=duration_s * NS_PER_S)


def finished(bench: Bench) -> str:
    bench.run_until(bench.end)
    bench.finish()
    return bench.trace.sha256


def test_a_run_with_the_firmware_equals_the_run_with_the_model() -> None:
    assert finished(Bench(scenario("firmware"))) == finished(Bench(scenario("model")))


def test_wheels_commanded_by_duty_drive_the_same_way_with_either() -> None:
    runs = [Bench(scenario(core, "dodge-duty", 8)) for core in ("model", "firmware")]
    assert finished(runs[0]) == finished(runs[1])
    assert runs[0].parts.adapter is not None
    assert runs[0].parts.adapter.status.motors == (750, 750)


def test_a_run_by_duty_goes_on_from_half_way_with_the_firmware() -> None:
    first, second = Bench(scenario("firmware", "dodge-duty", 6)), Bench(scenario("firmware", "dodge-duty", 6))
    first.run_until(4 * NS_PER_S + 777_777)
    saved = first.snapshot()
    finished(first)
    second.restore(saved)
    finished(second)
    assert second.trace.text == first.trace.text


@pytest.mark.slow
def test_dodge_drives_the_same_way_with_either() -> None:
    runs = [Bench(scenario(core, "dodge", 30)) for core in ("model", "firmware")]
    assert finished(runs[0]) == finished(runs[1])


def test_a_run_with_the_firmware_goes_on_from_half_way() -> None:
    first, second = Bench(scenario("firmware")), Bench(scenario("firmware"))
    first.run_until(5 * NS_PER_S)
    saved = first.snapshot()
    finished(first)
    second.restore(saved)
    finished(second)
    assert second.trace.text == first.trace.text


def test_numbers_that_the_firmware_cannot_hold_are_refused_in_one_line() -> None:
    with pytest.raises(UsageError, match="refuses its numbers: sample_count must be odd, 1 to 31"):
        FirmwareAdapter(
            pins=FakePins(), pinout=PINOUT, parameters=PARAMETERS, settings=AdapterSettings(sample_count=33)
        )


@pytest.mark.parametrize(
    ("name", "full"), [("pad_trigger_dead", gamepad.TRIGGER_FULL), ("pad_stick_dead", gamepad.STICK_FULL)]
)
def test_a_dead_zone_of_all_but_the_last_step_is_taken_and_of_all_refused_by_both(name: str, full: int) -> None:
    settings = AdapterSettings(**{name: full - 1})
    FirmwareAdapter(pins=FakePins(), pinout=PINOUT, parameters=PARAMETERS, settings=settings)
    with pytest.raises(UsageError, match=f"{name} = {full}.* leave nothing"):
        AdapterSettings(**{name: full})
    object.__setattr__(settings, name, full)
    with pytest.raises(UsageError, match="a dead zone of the pad leaves nothing"):
        FirmwareAdapter(pins=FakePins(), pinout=PINOUT, parameters=PARAMETERS, settings=settings)


@pytest.mark.parametrize(("scale", "is_taken"), [(1, True), (2, False), (0.5, True)])
def test_a_heading_whose_turn_is_no_part_of_the_modulus_is_refused(
    scale: float, is_taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = robot_numbers(PARAMETERS) | {"angle_counts_per_turn": int(HEADING_MODULUS * scale)}
    monkeypatch.setattr("robot_bench.adapter.robot_numbers", lambda _parameters: numbers)
    with nullcontext() if is_taken else pytest.raises(UsageError, match="must divide the modulus of the heading"):
        FirmwareAdapter(pins=FakePins(), pinout=PINOUT, parameters=PARAMETERS, settings=AdapterSettings())


def test_a_failure_of_the_far_side_comes_out_behind_the_firmware() -> None:
    class BrokenPins(FakePins):
        def read(self, signal: str, at: int) -> bool:
            raise OSError(f"{signal} at {at} ns: the bank is gone")

    adapter = FirmwareAdapter(pins=BrokenPins(), pinout=PINOUT, parameters=PARAMETERS)
    with pytest.raises(OSError, match="the bank is gone"):
        adapter.advance_to(NS_PER_S)


@pytest.mark.parametrize("kind", [Adapter, FirmwareAdapter])
def test_passes_count_from_where_the_chip_began(kind: type) -> None:
    """From power, and after a reset from the fall of rst: SIPs show at instants of that phase only."""
    rig = Rig(now=300_000, kind=kind, receiver=Receiver())
    rig.connect()
    assert connected_at(rig) % MS == 300_000
    falls_at = rig.now // MS * MS + 20 * MS + 700_000
    rig.pins.set("rst", True, falls_at - 10 * MS)
    rig.pins.set("p2dx_con", False, falls_at - 10 * MS)
    rig.run(falls_at - 1)
    rig.pins.set("rst", False, falls_at)
    rig.run(falls_at)
    rig.connect()
    assert connected_at(rig) % MS == 700_000


def connected_at(rig: Rig) -> int:
    return next(at for at, what, _ in reversed(rig.events) if what == "connected")
