"""The ESP32 adapter as a model: pins of a BluePill on one side, P2OS on the other.

It knows the pin-out (pinout.toml), the robot's parameters and the protocol, but
neither the chip nor the world: it meets them at wires.
"""

from adapter_sim.adapter import Adapter, AdapterState, AdapterStatus
from adapter_sim.codec import BitOrder, encoder_code, is_near, motor_code, motor_value
from adapter_sim.distances import threshold_um
from adapter_sim.faults import BrownOut, FaultyPins, Glitch, SlowLoop, StuckPin
from adapter_sim.masters import Gamepad, Master
from adapter_sim.mixing import Mixer, Speeds
from adapter_sim.pinout import Pinout, PinoutError, load_pinout, parse_pinout
from adapter_sim.pins import EventCallback, PinBank
from adapter_sim.settings import AdapterSettings, EncoderAtOpen, MotorMeaning
from adapter_sim.waveforms import Waveforms
from p2os.gamepad import PadReport

__all__ = [
    "Adapter",
    "AdapterSettings",
    "AdapterState",
    "AdapterStatus",
    "BitOrder",
    "BrownOut",
    "EncoderAtOpen",
    "EventCallback",
    "FaultyPins",
    "Gamepad",
    "Glitch",
    "Master",
    "Mixer",
    "MotorMeaning",
    "PadReport",
    "PinBank",
    "Pinout",
    "PinoutError",
    "SlowLoop",
    "Speeds",
    "StuckPin",
    "Waveforms",
    "encoder_code",
    "is_near",
    "load_pinout",
    "motor_code",
    "motor_value",
    "parse_pinout",
    "threshold_um",
]
