"""A firmware core, a virtual Pioneer and a bad line between them, on one virtual clock, with every promise checked.

    adapter core (C++) ── line with bit errors, unplugged now and then ── p2os.pioneer ── kinematic body

The BluePill here changes its motor values every few seconds, and asks anew when the adapter has lost the robot.
"""

import random
from dataclasses import dataclass, field

from adapter_sim.pins import released_codes
from p2os.errors import RemoteProtocolError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer, SonarPerSip
from p2os.pioneer.world import load_world
from p2os.protocol.commands import Command
from p2os.protocol.frames import Decoder, Frame
from p2os.robots.parameters import load_parameters
from robot_bench.adapter import FirmwareAdapter
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.adapter_sim.conftest import PINOUT, Rig

MS = NS_PER_MS
#: Start bit, eight of data, stop bit.
BITS_PER_CHARACTER = 10
#: What three motor bits can ask for: four steps of 62.5 mm/s, and 80 deg/s on a track of 357 mm.
MOST_MM_S, MOST_DEG_S = 250, 81
ENCODERS = ("encoder1", "encoder2")


class BadLine:
    """Flips bits at a rate; a start or stop bit that flips makes the character any other."""

    def __init__(self, bit_error_rate: float, random_source: random.Random) -> None:
        self._rate, self._random_source = bit_error_rate, random_source
        self.frames = self.damaged = 0
        #: What went in and what came out, of the last frame.
        self.last: tuple[bytes, bytes] = (b"", b"")

    def damage(self, frame: bytes) -> bytes:
        data, random_source = bytearray(frame), self._random_source
        place = int(random_source.expovariate(self._rate)) if self._rate else 1 << 60
        while place < len(data) * BITS_PER_CHARACTER:
            character, bit = divmod(place, BITS_PER_CHARACTER)
            data[character] ^= 1 << (bit - 1) if 1 <= bit <= 8 else random_source.randrange(1, 256)
            place += 1 + int(random_source.expovariate(self._rate))
        self.frames += 1
        self.damaged += data != frame
        self.last = (frame, bytes(data))
        return bytes(data)


@dataclass
class Received:
    """What the robot takes out of its line: each speed with its time."""

    decoder: Decoder = field(default_factory=Decoder)
    speeds: dict[str, int] = field(default_factory=dict)
    at: dict[str, Nanos] = field(default_factory=dict)

    def take(self, data: bytes, now: Nanos) -> None:
        self.decoder.receive(data, now)
        while (item := self.decoder.next_item()) is not None:
            if isinstance(item, Frame):
                try:
                    command = Command.from_frame(item)
                except RemoteProtocolError:  # a wrong frame whose sum fits
                    continue
                if command.name in {"VEL", "RVEL"}:
                    self.speeds[command.name], self.at[command.name] = command.integer or 0, now


class HardConditions:
    """One adapter under them; `run` runs it, every promise is checked on the way."""

    def __init__(self, seed: int, *, bit_error_rate: float) -> None:
        self.random_source = random_source = random.Random(seed)
        parameters = load_parameters("p2dx")
        world = load_world("room", seed=seed)
        body = make_body("kinematic", world, parameters)
        body.reset(world.start, seed)
        settings = ControllerSettings(sonar_per_sip=SonarPerSip.ALL)
        self.robot = Pioneer(parameters=parameters, body=body, settings=settings)
        self.rig = rig = Rig(robot=self.robot, kind=FirmwareAdapter)
        self.received = Received()
        self.forth, self.back = BadLine(bit_error_rate, random_source), BadLine(bit_error_rate, random_source)
        rig.to_robot.damage, rig.to_adapter.damage = self.forth.damage, self.back.damage
        receive = self.robot.receive

        def note(data: bytes, now: Nanos) -> None:
            self.received.take(data, now)
            receive(data, now)

        self.robot.receive = note
        self.codes = dict(zip(ENCODERS, released_codes(PINOUT), strict=True))
        self.counts = {"unplugged": 0, "reboots": 0, "sessions": 0, "losses": 0, "code_steps": 0, "forged": 0}
        #: The longest that the robot held a wrong speed: received all along, and while a damaged count hid what came.
        self.longest_wrong_ns = self.longest_hidden_ns = 0
        self._wrong_since: Nanos | None = None
        self._was_hidden = False
        self._plugged_at: Nanos = 0
        self._request_at: Nanos = 0
        self._motors_at: Nanos = 0

    def run(self, span: Nanos, *, unplug: int, reboot: int, forge: int = 0) -> None:
        """Run for a span with so many accidents at random times."""
        kinds = ["unplug"] * unplug + ["reboot"] * reboot + ["forge"] * forge
        end = self.rig.now + span
        accidents = sorted((self.random_source.randrange(self.rig.now, end), kind) for kind in kinds)
        self.rig.pins.set("p2dx_con", True, self.rig.now)
        while self.rig.now < end:
            while accidents and accidents[0][0] <= self.rig.now:
                getattr(self, f"_{accidents.pop(0)[1]}")()
            self._connect_request()
            self.rig.run(self.rig.now + 20 * MS)
            self._check()

    def drain(self) -> None:
        """Let what is on its way arrive, and what has begun be given up (250 ms of silence)."""
        self.rig.to_adapter.cut = True
        self.rig.run(self.rig.now + 330 * MS)

    def _unplug(self) -> None:
        self.counts["unplugged"] += 1
        self.rig.to_robot.cut = self.rig.to_adapter.cut = True
        self._plugged_at = self.rig.now + self.random_source.randrange(30 * MS, 3 * NS_PER_S)

    def _reboot(self) -> None:
        """Forget the session and stand, as a controller that is switched off and on."""
        self.counts["reboots"] += 1
        self.robot.hang_up(self.rig.now)

    def _forge(self) -> None:
        """Give the robot a speed that nobody sent, with a right sum."""
        if self.rig.adapter.state == "driving" and not self.rig.to_robot.cut:
            self.counts["forged"] += 1
            wrong = Command.from_frame(Frame(bytes((11, 0x3B, 0xC8, 0)))).to_frame().to_bytes()
            self.robot.receive(wrong, self.rig.now)

    def _connect_request(self) -> None:
        """Be the BluePill: new motors, and the connect request anew after a loss."""
        rig = self.rig
        if self._plugged_at and rig.now >= self._plugged_at:
            rig.to_robot.cut = rig.to_adapter.cut = False
            self._plugged_at = 0
        if rig.adapter.state == "lost" and rig.now >= self._request_at:
            rig.pins.set("p2dx_con", False, rig.now)
            rig.pins.set("p2dx_con", True, rig.now + 40 * MS)
            self._request_at = rig.now + NS_PER_S
        if rig.now >= self._motors_at:
            rig.pins.motors(self.random_source.randint(-4, 3), self.random_source.randint(-4, 3), rig.now)
            self._motors_at = rig.now + self.random_source.randrange(500 * MS, 4 * NS_PER_S)

    # Promises.

    def _check(self) -> None:
        self._check_limits()
        self._check_speed()
        self._check_codes()
        self._check_events()
        del self.rig.to_robot.log[:], self.rig.to_adapter.log[:], self.rig.pins.writes[:], self.rig.events[:]
        for history in self.rig.pins.history.values():
            while len(history) > 1 and history[1][0] <= self.rig.now:
                del history[0]

    def _check_limits(self) -> None:
        for _, name, value in self.rig.sent():
            assert not (name == "VEL" and abs(int(value)) > MOST_MM_S), value
            assert not (name == "RVEL" and abs(int(value)) > MOST_DEG_S), value
        state = self.robot.state
        rim = max(abs(state.left_setpoint_mps), abs(state.right_setpoint_mps))
        assert rim <= 0.75 + 0.357 / 2 * 1.75, "beyond what the robot allows itself"

    def _check_speed(self) -> None:
        """Measure how long the robot held another speed than the adapter's last."""
        speeds = self.rig.adapter.status.speeds
        wanted = {"VEL": speeds.forward_mm_s, "RVEL": speeds.turn_deg_s}
        is_whole = self.rig.adapter.state == "driving" and not self.rig.to_robot.cut
        if not is_whole or self.received.speeds == wanted:
            self._wrong_since, self._was_hidden = None, False
            return
        self._wrong_since = self._wrong_since or self.rig.now
        # The line delivers whole frames: a frame that has begun waits for bytes that its count only claims.
        self._was_hidden = self._was_hidden or self.received.decoder.next_deadline() is not None
        span = self.rig.now - self._wrong_since
        if self._was_hidden:
            self.longest_hidden_ns = max(self.longest_hidden_ns, span)
        else:
            self.longest_wrong_ns = max(self.longest_wrong_ns, span)

    def _check_codes(self) -> None:
        """Follow each encoder's code; it goes to a neighbour, or stays."""
        changes: dict[Nanos, dict[str, bool | None]] = {}
        for at, signal, level in self.rig.pins.writes:
            if signal.startswith("encoder"):
                changes.setdefault(at, {})[signal] = level
        for _, levels in sorted(changes.items()):
            for name in ENCODERS:
                code = self.codes[name]
                for bit in range(3):
                    level = levels.get(f"{name}_s{bit + 1}", bool(code >> bit & 1))
                    code = code & ~(1 << bit) | bool(level) << bit
                assert (code - self.codes[name]) % 8 in {0, 1, 7}, f"{name} jumps from {self.codes[name]} to {code}"
                self.counts["code_steps"] += code != self.codes[name]
                self.codes[name] = code

    def _check_events(self) -> None:
        for _, what, detail in self.rig.events:
            self.counts["sessions"] += what == "connected"
            if what in {"lost", "implausible"}:
                self.counts["losses"] += 1
                assert detail, "a loss has a reason"
