"""Lives of model and firmware that stand on every boundary: at it, one before it, one behind it.

A life is made of a seed: settings, a robot, the instant at which power comes, and some forty
steps. `LIFE_STEPS` lists the kinds of steps with their weights. Instants are those that
the model has planned, so that a silence of exactly each time-out comes about whatever the settings are.
"""

from dataclasses import replace
from random import Random

from adapter_sim import AdapterSettings
from adapter_sim.adapter import OPEN_STATES, AdapterState
from adapter_sim.codec import BitOrder
from adapter_sim.distances import threshold_um
from adapter_sim.masters import Master
from adapter_sim.settings import EncoderAtOpen, MotorCommand, MotorMeaning
from p2os.gamepad import PadReport
from p2os.protocol.frames import HEADER, MAX_COUNT, checksum
from p2os.protocol.odometry import POSITION_MODULUS
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading
from simbase.timing import NS_PER_S, Nanos
from tests.adapter_fw.sequences import Sequence
from tests.adapter_fw.twins import MS

#: Steps of a life.
STEPS = 40
#: Robots: 0.268 mm of sonar a unit and millimetres; two speeds and scales that are not round; 1024 headings a turn.
ROBOTS = ("p2dx", "p2dx", "p2dx", "p3dx", "amigo", "pion1m")
#: Where a counter of 31, 32 or 53 bits of ns, µs or ms would wrap.
WRAPS = (0, *(unit << bits for unit in (1, 1_000, 1_000_000) for bits in (31, 32)), 1 << 53)
#: A sonar unit of the 2-DX, in µm: thresholds are its multiples, or equality never happens.
UNIT_UM = 268
BESIDE = (-1, 0, 1)


def life_settings(rng: Random) -> AdapterSettings:
    """Return settings whose times meet each other and the samples."""
    spacing = rng.choice([25, 100]) * MS
    return AdapterSettings(
        threshold_um=rng.choice([None, 0, UNIT_UM, 2_239 * UNIT_UM, 4_850 * UNIT_UM, 1_000_000]),
        motor_command=rng.choice([MotorCommand.BITS, MotorCommand.BITS, MotorCommand.DUTY]),
        duty_timeout_ns=rng.choice([5, 25]) * MS,
        bit_order=rng.choice(list(BitOrder)),
        motor_meaning=rng.choice([MotorMeaning.WHEELS, MotorMeaning.WHEELS, MotorMeaning.LINEAR_ANGULAR]),
        step_um_per_s=rng.choice([62_500, 62_500, 100_001, 250_000, 0]),
        angular_step_urad_per_s=rng.choice([425_000, 8_727, 0]),
        # 187.5 mm/s are three steps: just below, at and just above what is wanted.
        max_velocity_mm_s=rng.choice([None, None, 0, 187, 188, 189]),
        max_rotation_deg_s=rng.choice([None, None, 0, 10, 60, 70]),
        sample_period_ns=rng.choice([2, 5, 5, 10]) * MS,
        sample_count=rng.choice([1, 3, 5, 5, 31]),
        connect_after_ns=rng.choice([0, 10, 10, 20]) * MS,
        disconnect_after_ns=rng.choice([0, 10, 10, 20]) * MS,
        boot_ns=rng.choice([0, 1, 300 * MS]),
        pair_spacing_ns=spacing,
        refresh_ns=rng.choice([spacing, 200 * MS]),
        pulse_ns=rng.choice([100, 180, 500]) * MS,
        liveness_ns=rng.choice([200, 350, 350]) * MS,
        first_sip_ns=rng.choice([300, 1_000]) * MS,
        retry_ns=rng.choice([100, 1_000]) * MS,
        plausibility_ns=rng.choice([200, 1_000, 1_000]) * MS,
        plausibility_tolerance_mm_s=rng.choice([0, 1, 40]),
        plausibility_progress_mm_s=rng.choice([1, 5]),
        distance_stale_ns=rng.choice([150, 1_000]) * MS,
        settle_ns=rng.choice([1, 100 * MS, 500 * MS]),
        encoder_at_open=rng.choice(list(EncoderAtOpen)),
        encoder_dwell_ns=rng.choice([0, 5 * MS, 20 * MS]),
        stop_unknown_robot=rng.random() < 0.8,
        stop_repeats=rng.choice([0, 1, 3]),
        stop_repeat_ns=rng.choice([100, 200]) * MS,
        bauds=rng.choice([(9_600,), (9_600, 38_400), (1, 2, 3, 4, 5, 6, 7, 8)]),
        pad_velocity_mm_s=rng.choice([0, 400]),
        pad_rotation_mrad_s=rng.choice([0, 1_700]),
        pad_trigger_dead=rng.choice([0, 40, 1_022]),
        pad_stick_dead=rng.choice([0, 40, 510]),
        pad_loss_ns=rng.choice([40, 150, 150]) * MS,
    )


class Life:
    """One life, to be lived once.

    Args:
        seed: Of everything that is chosen.
    """

    def __init__(self, seed: int) -> None:
        self.rng = rng = Random(seed)
        settings = life_settings(rng)
        robot = rng.choice(ROBOTS)
        wrap = rng.choice(WRAPS)
        start = max(0, wrap - rng.choice([0, 1, MS, 310 * MS, 2 * NS_PER_S]))
        self.sequence = Sequence(settings, has_four_bits=rng.random() < 0.25, robot=robot, start=start)
        self.twins = self.sequence.twins

    def live(self) -> None:
        """Live it: the twins compare themselves after each step.

        Raises:
            AssertionError: Model and firmware differ.
        """
        kinds = list(LIFE_STEPS)
        for _ in range(STEPS):
            if self.twins.model.state is not AdapterState.DRIVING and self.rng.random() < 0.4:
                self.sequence.rim_speed = self.rng.choice([0, 0, 1, -41])
                self.sequence.step("connect", self.rng.random() < 0.6)
            kind = self.rng.choices(kinds, weights=[LIFE_STEPS[kind] for kind in kinds])[0]
            getattr(self, "_" + kind.replace(" ", "_"))()
            self.twins.pass_time(self.rng.choice([0, 0, 1 * MS, 20 * MS, 60 * MS]))

    # What a SIP says.

    def _threshold(self) -> None:
        model = self.twins.model
        unit = model.parameters.range_um_per_count
        nearest = threshold_um(model.settings.threshold_um, model.parameters) // unit
        raws = [max(0, min(0xFFFF, nearest + self.rng.choice(BESIDE))) for _ in range(4)]
        numbers = self.rng.choices([0, 1, 6, 7, 8, 15, 16, 255], k=len(raws))
        self.twins.send_sip(sonar=tuple(map(SonarReading, numbers, raws)))

    def _heading_jump(self) -> None:
        counts = self.twins.model.parameters.angle_counts_per_turn
        step = self.rng.choice([counts // 4, counts // 4, counts // 2, counts // 2, 1]) + self.rng.choice(BESIDE)
        heading = self.twins.sip.raw_heading + self.rng.choice([-1, 1]) * step
        self._odometry(raw_heading=(heading + counts) % (2 * counts) - counts, dx=self.rng.choice([0, 100, -100]))

    def _longest_step(self) -> None:
        longest = self.twins.model._codes.encoders._longest_counts
        step = self.rng.choice([longest, longest, POSITION_MODULUS // 2]) + self.rng.choice(BESIDE)
        step *= self.rng.choice([-1, 1])
        place = {"dx": step} if self.rng.random() < 0.5 else {"dy": step}
        self._odometry(**place, raw_heading=self.rng.choice([0, 1, 512, 700, 1_024, 2_047, -1]))

    def _small_steps(self) -> None:
        """Travel of a few counts, so that codes cross their boundaries one way and the other."""
        for _ in range(self.rng.randrange(1, 6)):
            turn = self.rng.choice([0, 0, 1, -1, 40, -40])
            self._odometry(dx=self.rng.randrange(-80, 80), raw_heading=self.twins.sip.raw_heading + turn)
            self.twins.pass_time(100 * MS)

    def _odometry(self, *, dx: int = 0, dy: int = 0, raw_heading: int = 0) -> None:
        sip, speeds = self.twins.sip, self.twins.model._driver.plausibility.command
        self.twins.send_sip(
            raw_x=(sip.raw_x + dx) % POSITION_MODULUS,
            raw_y=(sip.raw_y + dy) % POSITION_MODULUS,
            raw_heading=max(-0x8000, min(0x7FFF, raw_heading)),
            raw_left_velocity=max(-0x8000, min(0x7FFF, speeds[0])),
            raw_right_velocity=max(-0x8000, min(0x7FFF, speeds[1])),
        )

    def _tolerance(self) -> None:
        """Speeds whose error is the tolerance, or the least one less the progress; for seconds."""
        settings = self.twins.model.settings
        for _ in range(self.rng.randrange(1, 13)):
            check = self.twins.model._driver.plausibility
            error = self.rng.choice(
                [settings.plausibility_tolerance_mm_s, check._least_error - settings.plausibility_progress_mm_s]
            )
            error = self.rng.choice([-1, 1]) * max(0, error + self.rng.choice(BESIDE))
            left, right = self.rng.choice([(error, 0), (0, error), (error, error), (error, -error)])
            conversion = self.twins.model.parameters.velocity_um_s_per_count
            self.twins.send_sip(
                raw_left_velocity=(check.command[0] + left) * 1_000 // conversion,
                raw_right_velocity=(check.command[1] + right) * 1_000 // conversion,
                stall_left=self.rng.random() < 0.05,
                stall_right=self.rng.random() < 0.05,
            )
            self.twins.pass_time(100 * MS)

    def _short_sip(self) -> None:
        sonar = tuple(SonarReading(number, 900) for number in range(self.rng.randrange(4)))
        payload = replace(self.twins.sip, sonar=sonar).to_frame(Profile.P2OS).payload
        cut = self.rng.choice([1, 2, 3, 4, 5, 6, len(payload) - 19, len(payload) - 20, len(payload) - 21])
        self.twins.frame(payload[:-cut])

    # What the line brings.

    def _count(self) -> None:
        """Frames at the greatest count and the least, sound and damaged, in pieces."""
        count = self.rng.choice([0, 1, 2, 3, 4, MAX_COUNT - 1, MAX_COUNT, MAX_COUNT + 1, 255])
        payload = bytes([self.rng.choice([0x20, 0x90, 0x32, 0xFE, 0, 1, 2])]) + self.rng.randbytes(max(0, count - 3))
        data = HEADER + bytes([count]) + payload + checksum(payload).to_bytes(2, "big")
        if self.rng.random() < 0.3:
            place = self.rng.randrange(len(data))
            data = data[:place] + bytes([data[place] ^ 1 << self.rng.randrange(8)]) + data[place + 1 :]
        data += self.rng.choice([b"", HEADER[:1], HEADER, HEADER + b"\x03", self._sip_bytes()])
        cut = self.rng.randrange(len(data))
        self.twins.receive(data[:cut])
        self.twins.pass_time(self.rng.choice([1 * MS, 100 * MS, 249 * MS, 250 * MS, 251 * MS]))
        self.twins.receive(data[cut:])

    def _nested(self) -> None:
        """A damaged frame that holds another one, and behind that a sound one."""
        damaged = bytearray(self._sip_bytes())
        damaged[-1] ^= 1
        body = self.rng.choice([bytes(damaged), b""]) + self._sip_bytes() + self.rng.choice([b"", self._sip_bytes()])
        self.twins.receive(HEADER + bytes([len(body) + 2]) + body + b"\x00\x01")

    def _sip_bytes(self) -> bytes:
        return self.twins.sip.to_frame(Profile.P2OS).to_bytes()

    # When things come.

    def _at_deadline(self) -> None:
        """Something at the very instant that is planned, or the one beside it."""
        at = self._planned() + self.rng.choice(BESIDE)
        if at <= self.twins.now:
            return
        self.twins.go_before(at)
        what = self.rng.choice(
            ["sip", "sip", "byte", "half frame", "pad", "pin", "motors", "answer", "rare", "nothing"]
        )
        getattr(self, "_come_" + what.replace(" ", "_"))()
        self.twins.pass_time(0)

    def _planned(self) -> Nanos:
        """Return an instant of the next seconds at which the model means to do something."""
        model, now = self.twins.model, self.twins.now
        agenda = model._agenda
        plans = [
            model.session.next_deadline(), model._masters.pad_lost_at, model._stop_repeater.due_at,
            model.distances.expires_at, agenda.boot_at, agenda.retry_at, agenda.sip_deadline, agenda.settle_at,
            agenda.sonar_at, model._driver.plausibility.ends_at, model._driver.pair_due_at(now), model.samples.next,
            *model._codes.due_at(now), now + 250 * MS,
        ]  # fmt: skip
        return self.rng.choice([plan for plan in plans if plan is not None and now < plan < now + 2 * NS_PER_S])

    def _come_sip(self) -> None:
        self.twins.send_sip()

    def _come_byte(self) -> None:
        self.twins.receive(self.rng.choice([b"\x00", HEADER[:1], HEADER]))

    def _come_half_frame(self) -> None:
        data = self._sip_bytes()
        self.twins.receive(data[: self.rng.randrange(1, len(data))])

    def _come_pad(self) -> None:
        self._pad()

    def _come_pin(self) -> None:
        level = self.twins.sides[0].pins.read("p2dx_con", self.twins.now)
        self.twins.pin("p2dx_con", not level, after=0)

    def _come_motors(self) -> None:
        self.twins.motors(*self._motor_values(), self.sequence.width)

    def _come_answer(self) -> None:
        self.twins.answer()

    def _come_rare(self) -> None:
        self.rng.choice([self.twins.shutdown, lambda: self.twins.master(self.rng.choice(list(Master)))])()

    def _come_nothing(self) -> None:
        pass

    def _silence(self) -> None:
        """Nothing at all, until whatever is planned has come; or a robot that answers a SYNC in the last instant."""
        self.twins.pass_time(self.rng.choice([150, 350, 1_000, 2_100]) * MS)
        if self.twins.model.state is AdapterState.CONNECTING and self.rng.random() < 0.8:
            self.twins.answer()

    def _no_answer(self) -> None:
        """A robot that does not answer, with all that the adapter tries."""
        self.sequence.step("pin", "p2dx_con", False)
        self.twins.pass_time(300 * MS)
        self.sequence.step("pin", "p2dx_con", True)
        self.twins.pass_time(self.rng.choice([6_200, 7_500]) * MS)

    def _late(self) -> None:
        """Something comes, and what was due before it has not been asked for yet."""
        self.twins.now += self.rng.choice([1, 3 * MS, 30 * MS, 400 * MS])
        getattr(self, self.rng.choice(["_come_sip", "_come_byte", "_come_pad", "_come_rare", "_come_answer"]))()
        self.twins.pass_time(0)

    def _stream_on(self) -> None:
        """A robot that still streams, or has just stopped to, when the stop sequence is due again."""
        self.twins.pin("p2dx_con", False)
        self.twins.pass_time(40 * MS)
        due = self.twins.model._stop_repeater.due_at
        if due is not None and due - 100 * MS - 1 > self.twins.now:
            self.twins.go_before(due - 100 * MS + self.rng.choice(BESIDE))
            self.twins.send_sip()
            self.twins.pass_time(130 * MS)

    def _glitch(self) -> None:
        """A level for a whole number of samples, from the instant of a sample on."""
        period = self.twins.model.settings.sample_period_ns
        self.twins.go_before(self.twins.model.samples.next + self.rng.choice(BESIDE))
        name = self.rng.choice(["p2dx_con", "p2dx_con", "motor1_comm1", "motor2_comm3", "rst"])
        level = self.twins.sides[0].pins.read(name, self.twins.now)
        self.twins.pin(name, not level, after=0)
        self.twins.pin(name, level, after=self.rng.randrange(1, 14) * period + self.rng.choice(BESIDE))
        self.twins.pass_time(40 * MS)

    # What the masters want.

    def _motor_values(self) -> tuple[int, int]:
        most = 1 << (self.sequence.width - 1)
        return self.rng.choice([-most, -1, 0, 1, most - 1]), self.rng.choice([-most, -1, 0, 1, most - 1])

    def _motors(self) -> None:
        self.sequence.step("motors", *self._motor_values())

    def _pwm(self) -> None:
        """Periods at the time-out, and duties at halves of a thousandth; their ends beside a sample."""
        timeout = self.twins.model.settings.duty_timeout_ns
        period = self.rng.choice([1 * MS, 2_000, timeout // 2, timeout, 2 * timeout]) + self.rng.choice(BESIDE)
        high = self.rng.choice([1, period // 2, period * 4_995 // 10_000, period - 1]) + self.rng.choice((0, 1))
        self.twins.go_before(self.twins.model.samples.next + self.rng.choice(BESIDE))
        turns = self.rng.randrange(1, 5)
        self.sequence.step(
            "pwm", self.rng.choice((1, 2)), period, min(high, period - 1), turns, self.rng.random() < 0.3
        )
        self.twins.pass_time(self.rng.choice([1, timeout - 1 * MS, timeout, timeout + 10 * MS]))

    def _obey(self) -> None:
        command = self.twins.model._driver.plausibility.command
        conversion = self.twins.model.parameters.velocity_um_s_per_count
        for _ in range(self.rng.randrange(1, 5)):
            self.twins.send_sip(
                raw_left_velocity=command[0] * 1_000 // conversion, raw_right_velocity=command[1] * 1_000 // conversion
            )
            self.twins.pass_time(100 * MS)

    def _pad(self) -> None:
        up, down = self.rng.random() < 0.4, self.rng.random() < 0.1
        self.twins.pad(replace(self._deflected(), up=up, down=down))

    def _deflected(self) -> PadReport:
        """Return a report at or beside the dead zones and the ends, or anywhere."""
        settings = self.twins.model.settings
        triggers = [0, settings.pad_trigger_dead, 500, 1_023, self.rng.randrange(1_024)]
        sticks = [0, settings.pad_stick_dead, -settings.pad_stick_dead, 300, 511, -511, -512]
        sticks.append(self.rng.randrange(-512, 512))
        forward, backward = (self.rng.choice(triggers) + self.rng.choice(BESIDE) for _ in range(2))
        return PadReport(forward=forward, backward=backward, turn=self.rng.choice(sticks) + self.rng.choice(BESIDE))

    def _drive_by_pad(self) -> None:
        self.twins.master(Master.PAD)
        for number in range(32):
            if number < 2 or self.twins.model.state not in OPEN_STATES:
                self.twins.pad(PadReport(up=number == 1))
            else:
                self.twins.pad(self._deflected())
            if self.twins.model.state in OPEN_STATES and number % 3 == 0:
                self.twins.send_sip(raw_x=0, raw_y=0, raw_heading=0)
            self.twins.answer()
            self.twins.pass_time(30 * MS)

    def _connect(self) -> None:
        self.sequence.step("connect", self.rng.random() < 0.5)

    def _rare(self) -> None:
        self.sequence.step("rare", self.rng.choice(["shutdown", "reset", "restore", "half frame"]))


#: Kinds of steps, and how often each comes.
LIFE_STEPS = {
    "threshold": 3, "heading jump": 5, "longest step": 4, "small steps": 3, "tolerance": 4, "short sip": 2,
    "count": 2, "nested": 1, "at deadline": 12, "late": 3, "silence": 2, "no answer": 1, "stream on": 2, "glitch": 3,
    "motors": 3, "pwm": 3, "obey": 4, "pad": 2, "drive by pad": 2, "connect": 1, "rare": 1,
}  # fmt: skip
