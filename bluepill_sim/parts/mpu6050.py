"""MPU-6050: a gyroscope and an accelerometer on I2C, which sense how the board moves in its world.

Theory of operation. While it is awake it takes a sample each period of the sample rate: the world's motion goes
through a low pass for each axis, and into the registers, the FIFO and the data-ready interrupt. A read begins with a
copy of the fourteen bytes, so that a burst is of one sample. The robot's x, y and z are the chip's.

Modelled: 06 to 0C, 19 to 1C, 23, 37, 38, 3A, 3B to 48, 68, 6A to 6C, 72 to 75; the FIFO of 1024 bytes; INT with its
level, latch and clearing; standby of single axes; sleep, from which it starts; DEVICE_RESET. *Chosen*: the low pass is
of the first order at the bandwidth of DLPF_CFG; the accelerometer repeats itself where the rate is above 1 kHz; 25 °C;
the factory's offsets. Not modelled: noise, bias and what offsets do about it (they are kept), the auxiliary bus, DMP,
motion detection, self-test, cycle mode, the time to start (30 ms).
Source: InvenSense RM-MPU-6000A rev. 4.2 (registers), PS-MPU-6000A rev. 3.4 (6.1, 6.2: scales); 06 to 0C are in neither
and as two drivers read them, `mpu_init` of InvenSense's Motion Driver and `mpu6050Detect` of baseflight.
Invariant: sample n is taken n periods after the last change of the rate, whenever somebody looks.

"""

import math
import struct
from typing import ClassVar

from bluepill_sim.fabric.surroundings import GRAVITY_MPS2, BoardMotion
from bluepill_sim.parts.attached import Socket, Use
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

XA_OFFS_H, ZA_OFFS_L, PRODUCT_ID, XG_OFFS_USRH, ZG_OFFS_USRL = 0x06, 0x0B, 0x0C, 0x13, 0x18
SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, FIFO_EN = 0x19, 0x1A, 0x1B, 0x1C, 0x23
INT_PIN_CFG, INT_ENABLE, INT_STATUS, ACCEL_XOUT, GYRO_ZOUT_L = 0x37, 0x38, 0x3A, 0x3B, 0x48
SIGNAL_PATH_RESET, USER_CTRL, PWR_MGMT_1, PWR_MGMT_2, FIFO_COUNTH, FIFO_COUNTL, FIFO_R_W, WHO_AM_I = (
    0x68, 0x6A, 0x6B, 0x6C, 0x72, 0x73, 0x74, 0x75,
)  # fmt: skip
#: Offsets of both sensors: kept as written, and counted as ignored, for they do not move what it measures.
_OFFSETS = frozenset({*range(XA_OFFS_H, ZA_OFFS_L + 1), *range(XG_OFFS_USRH, ZG_OFFS_USRL + 1)})
#: The registers that a write changes, and which of their bits.
WRITABLE = {
    **dict.fromkeys(_OFFSETS, 0xFF),
    SMPLRT_DIV: 0xFF, CONFIG: 0x3F, GYRO_CONFIG: 0xF8, ACCEL_CONFIG: 0xF8, FIFO_EN: 0xFF, INT_PIN_CFG: 0xFE,
    INT_ENABLE: 0x19, USER_CTRL: 0x70, PWR_MGMT_1: 0x6F, PWR_MGMT_2: 0xFF,
}  # fmt: skip
#: What the factory wrote: the accelerometer's offsets, whose lowest bits are the part's revision (Z, Y, X: 2, full
#: sensitivity), and the product of silicon B1, which drivers read where the revision is 0.
FACTORY = {XA_OFFS_H: bytes.fromhex("fb82 0251 0698"), PRODUCT_ID: b"\x01", WHO_AM_I: b"\x68"}
#: Those that it has and that do nothing here: slaves of the auxiliary bus, motion detection, self-test.
_KNOWN = frozenset({0x0D, 0x0E, 0x0F, 0x10, 0x1F, *range(0x24, 0x37), *range(0x49, 0x68), 0x69})
#: LSB a g and a degree a second, by FS_SEL (PS 6.1, 6.2).
LSB_PER_G = (16384.0, 8192.0, 4096.0, 2048.0)
LSB_PER_DPS = (131.0, 65.5, 32.8, 16.4)
#: Bandwidth in Hz by DLPF_CFG: accelerometer, gyroscope (RM 4.3).
BANDWIDTH_HZ = ((260, 256), (184, 188), (94, 98), (44, 42), (21, 20), (10, 10), (5, 5), (260, 256))
FIFO_BYTES = 1024
_SLEEP, _DEVICE_RESET, _FIFO_ON, _FIFO_RESET, _SENSORS_RESET = 0x40, 0x80, 0x40, 0x04, 0x01
_DATA_READY, _FIFO_OVERFLOW = 0x01, 0x10
_ACTIVE_LOW, _LATCHED, _READ_CLEARS = 0x80, 0x20, 0x10
#: How long INT is active where it is not latched.
PULSE_NS: Nanos = 50_000
#: What goes into the FIFO by the bits of FIFO_EN: bytes of the sample.
_FIFO_PARTS = ((0x08, 0, 6), (0x80, 6, 8), (0x40, 8, 10), (0x20, 10, 12), (0x10, 12, 14))
_SAMPLE = struct.Struct(">7h")


class Mpu6050(Stateful):
    """A gyroscope and accelerometer on I2C, with `int` to a pin."""

    PINS: ClassVar = {"int": Use.HELD}
    STATE = (
        "samples", "ignored", "_registers", "_sample", "_shadow", "_fifo", "_filtered", "_pointer", "_has_pointer",
        "_since_ns", "_count", "_is_active",
    )  # fmt: skip
    DERIVED = ("_socket",)

    def __init__(self, *, address: int = 0x68, temperature_c: float = 25.0) -> None:
        """Make one that sleeps.

        Args:
            address: 0x68 or 0x69 (AD0 high).
            temperature_c: What its thermometer shows.

        Raises:
            ValueError: It cannot be there, or so warm.
        """
        if address not in {0x68, 0x69} or not -40 <= temperature_c <= 85:
            raise ValueError(f"no MPU-6050 at {address:#04x} and {temperature_c} degrees: 0x68 or 0x69, -40 to 85")
        self._address = address
        #: (°C - 36.53) * 340 (RM 4.18).
        self._raw_temperature = round((temperature_c - 36.53) * 340)
        #: How many samples it has taken, and writes to what is not modelled.
        self.samples = self.ignored = 0
        self._socket: Socket | None = None
        self._pointer, self._has_pointer = 0, False
        self._reset(0)

    def _reset(self, at_ns: Nanos) -> None:
        self._registers = bytearray(128)
        for first, values in FACTORY.items():
            self._registers[first : first + len(values)] = values
        self._registers[PWR_MGMT_1] = _SLEEP
        self._sample = self._shadow = bytes(_SAMPLE.size)
        self._fifo = bytearray()
        #: Of the low pass: forces in g, rates in degrees a second; None before the first sample.
        self._filtered: tuple[float, ...] | None = None
        #: Since when it samples at its rate, and how often it has.
        self._since_ns, self._count = at_ns, 0
        self._is_active = False

    def plug(self, socket: Socket) -> None:
        """Let INT go."""
        self._socket = socket
        if socket.has("int"):
            socket.pin("int").drive(0)

    # Samples.

    @property
    def rate(self) -> tuple[int, int]:
        """The sample rate in Hz, as a fraction: 8 or 1 kHz, and what divides it."""
        is_fast = self._registers[CONFIG] & 7 in {0, 7}
        return (8000 if is_fast else 1000), 1 + self._registers[SMPLRT_DIV]

    def next_deadline(self) -> Nanos | None:
        """Return when the next sample is taken; None while it sleeps."""
        if self._registers[PWR_MGMT_1] & _SLEEP:
            return None
        hz, divider = self.rate
        return self._since_ns + (self._count + 1) * divider * NS_PER_S // hz

    def advance_to(self, now_ns: Nanos) -> None:
        """Take the sample that is due."""
        self._count += 1
        self.samples += 1
        motion = self._socket.surroundings.motion() if self._socket is not None else BoardMotion()
        self._sample = self._converted(motion)
        registers = self._registers
        if registers[USER_CTRL] & _FIFO_ON:
            for bit, begin, end in _FIFO_PARTS:
                if registers[FIFO_EN] & bit:
                    self._fifo += self._sample[begin:end]
            if len(self._fifo) > FIFO_BYTES:
                del self._fifo[:-FIFO_BYTES]
                self._raise(_FIFO_OVERFLOW, now_ns)
        self._raise(_DATA_READY, now_ns)

    def _converted(self, motion: BoardMotion) -> bytes:
        forces = [force / GRAVITY_MPS2 for force in motion.force_mps2]
        rates = [math.degrees(rate) for rate in motion.rates_radps]
        values = (*forces, *rates)
        before = self._filtered
        hz, divider = self.rate
        accelerometer_hz, gyroscope_hz = BANDWIDTH_HZ[self._registers[CONFIG] & 7]
        shares = [1 - math.exp(-2 * math.pi * band * divider / hz) for band in (accelerometer_hz, gyroscope_hz)]
        if before is not None:
            values = tuple(
                old + shares[n // 3] * (new - old) for n, (old, new) in enumerate(zip(before, values, strict=True))
            )
        self._filtered = values
        per_g = LSB_PER_G[self._registers[ACCEL_CONFIG] >> 3 & 3]
        per_dps = LSB_PER_DPS[self._registers[GYRO_CONFIG] >> 3 & 3]
        standby = self._registers[PWR_MGMT_2]
        raw = [
            0 if standby >> 5 - n & 1 else min(max(round(value * (per_g if n < 3 else per_dps)), -0x8000), 0x7FFF)
            for n, value in enumerate(values)
        ]
        return _SAMPLE.pack(*raw[:3], self._raw_temperature, *raw[3:])

    # INT.

    def _raise(self, what: int, at_ns: Nanos) -> None:
        self._registers[INT_STATUS] |= what
        if self._registers[INT_ENABLE] & what:
            self._drive(True, at_ns)

    def _drive(self, is_active: bool, at_ns: Nanos) -> None:
        """Make INT active, for a pulse where it is not latched, or let it go."""
        is_latched = bool(self._registers[INT_PIN_CFG] & _LATCHED)
        self._is_active = is_active and is_latched
        if self._socket is None or not self._socket.has("int"):
            return
        active = int(not self._registers[INT_PIN_CFG] & _ACTIVE_LOW)
        levels = [(at_ns, active if is_active else 1 - active)]
        if is_active and not is_latched:
            levels.append((at_ns + PULSE_NS, 1 - active))
        self._socket.pin("int").drive_later(levels)

    # I2C.

    def start(self, address: int, is_read: bool, at_ns: Nanos) -> bool:
        """Acknowledge its address; a burst reads one sample."""
        self._has_pointer = is_read
        if is_read:
            self._shadow = self._sample
        return address == self._address

    def write(self, byte: int, at_ns: Nanos) -> bool:
        """Take the register's number, then what goes there."""
        if self._has_pointer:
            self._put(self._pointer, byte, at_ns)
            self._move_on()
        else:
            self._pointer, self._has_pointer = byte & 0x7F, True
        return True

    def read(self, at_ns: Nanos) -> int:
        """Return the next register; reading INT_STATUS, or any where INT_RD_CLEAR says so, clears it."""
        number = self._pointer
        self._move_on()
        if number == INT_STATUS or self._registers[INT_PIN_CFG] & _READ_CLEARS:
            status, self._registers[INT_STATUS] = self._registers[INT_STATUS], 0
            if self._is_active:
                self._drive(False, at_ns)
            if number == INT_STATUS:
                return status
        if ACCEL_XOUT <= number <= GYRO_ZOUT_L:
            return self._shadow[number - ACCEL_XOUT]
        if number in {FIFO_COUNTH, FIFO_COUNTL}:
            return len(self._fifo) >> (8 if number == FIFO_COUNTH else 0) & 0xFF
        if number == FIFO_R_W:
            return self._fifo.pop(0) if self._fifo else 0xFF
        return self._registers[number]

    def stop(self, at_ns: Nanos) -> None:
        """Nothing is left to do."""

    def words(self) -> str:
        """Return what it measures."""
        x, y, z, _, *rates = _SAMPLE.unpack(self._sample)
        per_g = LSB_PER_G[self._registers[ACCEL_CONFIG] >> 3 & 3]
        per_dps = LSB_PER_DPS[self._registers[GYRO_CONFIG] >> 3 & 3]
        turns = ", ".join(f"{rate / per_dps:+.1f}" for rate in rates)
        return f"{self.samples} samples, {x / per_g:+.2f}, {y / per_g:+.2f}, {z / per_g:+.2f} g, {turns} deg/s"

    def _move_on(self) -> None:
        if self._pointer != FIFO_R_W:
            self._pointer = (self._pointer + 1) & 0x7F

    def _put(self, number: int, byte: int, at_ns: Nanos) -> None:
        registers = self._registers
        if number == PWR_MGMT_1 and byte & _DEVICE_RESET:
            self._reset(at_ns)
            return
        if number in {SIGNAL_PATH_RESET, USER_CTRL}:
            if number == SIGNAL_PATH_RESET or byte & _SENSORS_RESET:
                self._sample = bytes(_SAMPLE.size)
            if number == USER_CTRL and byte & _FIFO_RESET:
                self._fifo.clear()
        elif number not in WRITABLE:
            self.ignored += number not in _KNOWN or byte != 0
            return
        self.ignored += number in _OFFSETS
        if number in WRITABLE:
            before = registers[number]
            registers[number] = byte & WRITABLE[number]
            is_rate = number in {SMPLRT_DIV, CONFIG} and before != registers[number]
            if is_rate or (number == PWR_MGMT_1 and (before ^ byte) & _SLEEP):
                self._since_ns, self._count = at_ns, 0
                if self._socket is not None:
                    self._socket.deadline_changed()
            if number == INT_PIN_CFG and (before ^ byte) & _ACTIVE_LOW:
                self._drive(self._is_active, at_ns)
