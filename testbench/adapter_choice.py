"""Which adapter stands between the wires and the robot: the model, or the firmware's own core."""

from typing import TypeAlias

from adapter_sim.adapter import Adapter
from adapter_sim.pinout import Pinout
from adapter_sim.ports import PinBank
from testbench.adapter_firmware import FirmwareAdapter
from testbench.scenario import Scenario

AnyAdapter: TypeAlias = Adapter | FirmwareAdapter

#: What a scenario and a command line call them.
_KINDS: dict[str, type[Adapter] | type[FirmwareAdapter]] = {"model": Adapter, "firmware": FirmwareAdapter}


def make_adapter(scenario: Scenario, pins: PinBank, pinout: Pinout) -> AnyAdapter:
    """Return the adapter that a scenario wants.

    Raises:
        MissingDependencyError: The firmware's core is wanted and was not built.
    """
    kind = _KINDS[scenario.adapter_core]
    return kind(pins=pins, pinout=pinout, parameters=scenario.parameters, settings=scenario.adapter)
