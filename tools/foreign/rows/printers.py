"""Klipper and grbl: steps at pins against what their hosts have commanded."""

from tools.foreign.judges.hosted import CountedEdges, Hosted, SwitchedAxis
from tools.foreign.row import ProgramKind, Row, Source

KLIPPER = Source(
    folder="klipper", url="https://github.com/Klipper3d/klipper", commit="84104bbbd7625d28b4eaaad83f4562972460ecd9"
)
#: A cartesian machine, 80 steps a millimetre on each axis, that is homed. PC14 marks that it is, PB1 has a servo.
_MACHINE = """[mcu]
{mcu}
[printer]
kinematics: cartesian
max_velocity: 100
max_accel: 1000
[stepper_x]
step_pin: PA0
dir_pin: PA1
enable_pin: !PA2
microsteps: 16
rotation_distance: 40
endstop_pin: PA3
position_endstop: 0
position_max: 200
homing_speed: 20
[stepper_y]
step_pin: PA4
dir_pin: PA5
microsteps: 16
rotation_distance: 40
endstop_pin: PA6
position_endstop: 0
position_max: 200
homing_speed: 20
[stepper_z]
step_pin: PB3
dir_pin: PB4
microsteps: 16
rotation_distance: 40
endstop_pin: PB5
position_endstop: 0
position_max: 200
homing_speed: 20
[force_move]
[output_pin mark]
pin: PC14
[servo arm]
pin: PB1
initial_angle: 90
"""
#: 40, 20 and 10 mm there and back, and the last not back.
_JOB = """G28
SET_PIN PIN=mark VALUE=1
G4 P300
G1 X40 Y20 F3000
G1 X0 Y0 F3000
G1 Z10 F1200
G4 P500
M400
"""
_AXES = (
    SwitchedAxis(step="PA0", direction="PA1", switch="PA3", above=400),
    SwitchedAxis(step="PA4", direction="PA5", switch="PA6", above=300),
    SwitchedAxis(step="PB3", direction="PB4", switch="PB5", above=200),
)
#: 80 steps a millimetre; the firmware steps on one edge only.
_STEPS = (
    CountedEdges(pin="PA0", least=6400, since="PC14"),
    CountedEdges(pin="PA4", least=3200, since="PC14"),
    CountedEdges(pin="PB3", least=800, since="PC14"),
)
#: python-can's SocketCAN as the board's datagram socket, where there is no interface of SocketCAN.
_CAN_SHIM = """import os
import socket
import struct

import can


class DatagramBus(can.BusABC):
    def __init__(self, channel=None, can_filters=None, **_):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(f"{os.environ['BOARD_CAN']}.{id(self):x}")
        self.socket.connect(os.environ["BOARD_CAN"])
        self.socket.send(b"")
        super().__init__(channel=channel, can_filters=can_filters)

    def send(self, message, timeout=None):
        self.socket.send(struct.pack("=IB3x8s", message.arbitration_id, message.dlc, bytes(message.data)))

    def _recv_internal(self, timeout):
        self.socket.settimeout(timeout)
        try:
            identifier, length, data = struct.unpack("=IB3x8s", self.socket.recv(16))
        except TimeoutError:
            return None, False
        return can.Message(arbitration_id=identifier, data=data[:length], is_extended_id=False), False

    def fileno(self):
        return self.socket.fileno()


can.interface.Bus = DatagramBus
"""
_KLIPPY = (
    "{cache}/py/bin/python", "{cache}/klipper/source/klippy/klippy.py", "{scratch}/printer.cfg",
    "-i", "{scratch}/job.gcode", "-l", "{scratch}/klippy.log",
)  # fmt: skip
_KLIPPY_NEEDS = ("klipper/source/klippy/klippy.py", "py/lib/python*/site-packages/greenlet")


def _klippy(port: str, mcu: str, hosts: tuple[tuple[str, ...], ...], needs: tuple[str, ...] = ()) -> Hosted:
    return Hosted(
        image=f"klipper/{port}/klipper.elf",
        port="usart1" if port == "usart" else port,
        hosts=(*hosts, _KLIPPY, ("cat", "{scratch}/klippy.log")),
        hears=(r"Loaded MCU 'mcu' (\d+ commands)", r"Exiting"),
        host_needs=(*_KLIPPY_NEEDS, *needs),
        files=(
            ("printer.cfg", _MACHINE.replace("{mcu}", mcu)),
            ("job.gcode", _JOB),
            ("sitecustomize.py", _CAN_SHIM if port == "can" else ""),
        ),
        environment=(("PYTHONPATH", "{scratch}"), ("BOARD_CAN", "{can}")),
        axes=_AXES,
        edges=_STEPS,
        hosts_s=100.0,
    )


_KLIPPY_SAID = "its stock host homes three axes at switches, then moves 40, 20 and 10 mm; steps are counted"

PRINTERS = (
    Row(
        name="klippy-usart", kind=ProgramKind.FIRMWARE, source=KLIPPER, said=_KLIPPY_SAID,
        program="Klipper for an STM32F103, 8 MHz crystal, USART1 on PA10/PA9",
        judge=_klippy("usart", "serial: {line}", ()),
    ),
    Row(
        name="klippy-usb", kind=ProgramKind.FIRMWARE, source=KLIPPER, said=_KLIPPY_SAID,
        program="Klipper for an STM32F103, 8 MHz crystal, USB on PA11/PA12",
        judge=_klippy("usb", "serial: {line}", ()),
        found="double-buffered endpoints: it was dead over USB",
    ),
    Row(
        name="klippy-can", kind=ProgramKind.FIRMWARE, source=KLIPPER, said="the query finds it on CAN; then as above",
        program="Klipper for an STM32F103, 8 MHz crystal, CAN on PB8/PB9 at 1 Mbit/s",
        judge=_klippy(
            "can", "canbus_uuid: 8c9fbe56ebe7",
            (("{cache}/py/bin/python", "{cache}/klipper/source/scripts/canbus_query.py", "can0"),),
            needs=("py/lib/python*/site-packages/can",),
        ),
    ),
)  # fmt: skip
