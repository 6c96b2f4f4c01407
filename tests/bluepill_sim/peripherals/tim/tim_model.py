"""A timer that ticks: RM0008 chapters 14 and 15 as a plain program, one clock of CK_INT after the other.

The device in C works everything out from the time; this counts. They share nothing but the manual and what is
*chosen* (docs/peripherals.md), and have to agree on every register, pin, interrupt and TRGO.
"""

from collections.abc import Callable

NAMES = (
    "CR1", "CR2", "SMCR", "DIER", "SR", "EGR", "CCMR1", "CCMR2", "CCER", "CNT", "PSC", "ARR", "RCR",
    "CCR1", "CCR2", "CCR3", "CCR4", "BDTR",
)  # fmt: skip
#: Bits that a register takes, of TIM1 and of the others.
TAKEN = {
    "CR1": (0x3FF, 0x3FF), "CR2": (0x7FFD, 0xF8), "SMCR": (0xFFF7, 0xFFF7), "DIER": (0x7FFF, 0x5F5F),
    "CCMR1": (0xFFFF, 0xFFFF), "CCMR2": (0xFFFF, 0xFFFF), "CCER": (0x3FFF, 0x3333), "PSC": (0xFFFF, 0xFFFF),
    "ARR": (0xFFFF, 0xFFFF), "RCR": (0xFF, 0), "BDTR": (0xFFFF, 0),
    **{f"CCR{n}": (0xFFFF, 0xFFFF) for n in (1, 2, 3, 4)},
}  # fmt: skip
#: Flags that software clears.
FLAGS = (0x1EFF, 0x1E5F)
#: ICxF and ETF: samples that agree, division of the sampling clock, whether that is tDTS.
FILTERS = [
    (1, 1, False), (2, 1, False), (4, 1, False), (8, 1, False), (6, 2, True), (8, 2, True), (6, 4, True), (8, 4, True),
    (6, 8, True), (8, 8, True), (5, 16, True), (6, 16, True), (8, 16, True), (5, 32, True), (6, 32, True),
    (8, 32, True),
]  # fmt: skip
LOW, HIGH, FLOATING = range(3)
#: In ticks, more than any dead time.
LONG_AGO = 1 << 20


class Input:
    """One input with its filter."""

    def __init__(self) -> None:
        self.raw = self.out = False
        self.run = 0
        self.length, self.period = 1, 1


class Model:
    """One timer."""

    def __init__(self, *, is_advanced: bool) -> None:
        self.is_advanced = is_advanced
        self.now = 0
        self.r = dict.fromkeys(NAMES, 0) | {"ARR": 0xFFFF}
        self.cnt, self.down = 0, False
        self.arr, self.psc, self.ccr = 0xFFFF, 0, [0] * 4
        self.prescaler = self.repetitions = 0
        self.is_counting, self.starts = False, 0
        self.latched, self.cleared = [False] * 4, [False] * 4
        self.captured = [0] * 4
        self.inputs = [Input() for _ in range(5)]
        self.levels = [False] * 9  # CH1 to CH4, CH1N to CH3N, ETR, BKIN
        self.looked: set[int] = set()
        self.etr_was, self.etr_edges = False, 0
        self.itr, self.trigger = [False] * 4, False
        self.in_break, self.idle_from = False, 0
        self.lock: int | None = None
        self.ccer, self.modes = 0, [0] * 4
        self.edge_at, self.reference_was = [-LONG_AGO] * 3, [False] * 3
        #: (tick, level) of TRGO; pulses are (tick, 2).
        self.trgo: list[tuple[int, int]] = []
        self.trgo_level = False

    # Fields.

    def field(self, register: str, low: int, mask: int) -> int:
        return self.r[register] >> low & mask

    def ccmr(self, channel: int) -> int:
        return self.r["CCMR1" if channel < 2 else "CCMR2"] >> 8 * (channel % 2) & 0xFF

    def is_input(self, channel: int) -> bool:
        return bool(self.ccmr(channel) & 3)

    def is_on(self, channel: int) -> bool:
        return bool(self.ccer >> 4 * channel & 1)

    def is_inverted(self, channel: int) -> bool:
        return bool(self.r["CCER"] >> 4 * channel & 2)

    @property
    def sms(self) -> int:
        return self.field("SMCR", 0, 7)

    @property
    def ts(self) -> int:
        return self.field("SMCR", 4, 7)

    @property
    def mms(self) -> int:
        return self.field("CR2", 4, 7)

    @property
    def is_encoder(self) -> bool:
        return self.sms in {1, 2, 3}

    @property
    def is_centred(self) -> bool:
        return bool(self.field("CR1", 5, 3)) and not self.is_encoder

    # Time.

    def tick(self) -> None:
        self.now += 1
        if self.is_counting and self.now > self.starts:
            self.clock()
        for n, one in enumerate(self.inputs):
            if one.length > 1 and self.now % one.period == 0:
                one.run = one.run + 1 if one.raw != one.out else 0
                if one.run == one.length:
                    one.out, one.run = one.raw, 0
                    self.changed(n)
        self.finish()

    def clock(self) -> None:
        self.prescaler += 1
        if self.prescaler > self.psc:
            self.prescaler = 0
            self.count()

    def may_count(self) -> bool:
        return bool(self.r["CR1"] & 1) and self.arr > 0 and (self.sms != 5 or self.trigger)

    def look_whether_it_counts(self) -> None:
        counts = self.may_count() and self.sms != 7 and not self.is_encoder and not self.r["SMCR"] & 1 << 14
        if counts and not self.is_counting:
            self.starts = self.now + 1
        self.is_counting = counts

    def turn(self) -> None:
        """Where centre-aligned counting turns round."""
        if self.is_centred and self.cnt == 0:
            self.down = False
        elif self.is_centred and self.cnt == self.arr:
            self.down = True

    def count(self) -> None:
        before, was_beyond, is_over = self.cnt, self.cnt > self.arr, False
        if self.down:
            last = 1 if self.is_centred and not was_beyond else 0
            is_over = before == last and not was_beyond
            self.cnt = before - 1 if not is_over or self.is_centred else self.arr
        elif self.is_centred and not was_beyond:
            is_over = before == self.arr - 1
            self.cnt = before + 1
        else:
            is_over = before == self.arr
            self.cnt = 0 if is_over else (before + 1) & 0xFFFF
        went_down = self.down
        self.turn()
        loads = is_over and not self.repetitions and not self.r["CR1"] & 2
        for n in range(4):
            if not self.is_input(n):
                self.compare(n, is_over, went_down, was_beyond, loads=loads)
        if is_over:
            if self.repetitions:
                self.repetitions -= 1
            else:
                self.repetitions = self.r["RCR"]
                self.update(by_counter=True)

    def compare(self, n: int, is_over: bool, went_down: bool, was_beyond: bool, *, loads: bool) -> None:
        value, cms = self.ccr[n], self.field("CR1", 5, 3)
        meets = self.cnt == value
        if loads:  # the update event of this tick has put a new value there, and a new limit
            landed = self.r["ARR"] if self.down and self.cnt == self.arr else self.cnt
            meets = landed == self.r[f"CCR{n + 1}"]
        flagged = meets
        if self.is_centred and not was_beyond and 0 < value < self.arr and not loads:
            flagged = meets and (cms == 3 or (cms == 1) == went_down)
        if value > self.arr and not was_beyond:
            flagged = (loads and meets) or (is_over and (not self.is_centred or self.cnt == self.arr))
        if meets:
            mode = self.modes[n]
            self.latched[n] = {1: True, 2: False, 3: not self.latched[n]}.get(mode, self.latched[n])
        if flagged:
            self.channel_event(n)

    # Events.

    def update(self, *, by_counter: bool) -> None:
        if self.r["CR1"] & 2:
            return
        if by_counter and self.down and self.cnt == self.arr:
            self.cnt = self.r["ARR"]
        self.arr, self.psc = self.r["ARR"], self.r["PSC"]
        for n in range(4):
            if not self.is_input(n):
                self.ccr[n] = self.r[f"CCR{n + 1}"]
        if not self.inputs[4].out:
            self.cleared = [False] * 4
        if self.is_advanced and self.r["BDTR"] & 1 << 14 and not self.in_break:
            self.r["BDTR"] |= 1 << 15
        if by_counter or not self.r["CR1"] & 4:
            self.r["SR"] |= 1
        if self.mms == 2:
            self.trgo.append((self.now, 2))
        if self.r["CR1"] & 8:
            self.r["CR1"] &= ~1
        self.turn()
        self.look_whether_it_counts()

    def reinitialize(self) -> None:
        self.prescaler = 0
        self.repetitions = self.r["RCR"]
        self.update(by_counter=False)
        self.cnt = self.arr if self.down and not self.is_centred else 0
        self.turn()
        if self.mms == 0:
            self.trgo.append((self.now, 2))

    def channel_event(self, n: int) -> None:
        self.r["SR"] |= 2 << n
        if n == 0 and self.mms == 3:
            self.trgo.append((self.now, 2))

    def capture(self, n: int) -> None:
        if self.r["SR"] & 2 << n:
            self.r["SR"] |= 0x200 << n
        self.r[f"CCR{n + 1}"] = self.ccr[n] = self.cnt
        self.channel_event(n)

    def capture_edge(self, n: int) -> None:
        self.captured[n] += 1
        if self.captured[n] >= 1 << (self.ccmr(n) >> 2 & 3):
            self.captured[n] = 0
            self.capture(n)

    # Inputs.

    @property
    def uses_trigger(self) -> bool:
        return (
            self.sms >= 4
            or (self.sms != 0 and self.ts < 4)
            or any(self.is_on(n) and self.ccmr(n) & 3 == 3 for n in range(4))
            or self.r["CR2"] & 5 == 5
        )

    def trigger_level(self) -> bool:
        if self.ts < 4:
            return self.itr[self.ts]
        if self.ts == 4:
            return False
        if self.ts == 7:
            return self.inputs[4].out
        return self.inputs[self.ts - 5].out != self.is_inverted(self.ts - 5)

    def take_trigger(self) -> None:
        level = self.trigger_level()
        was, self.trigger = self.trigger, level
        if level == was or not self.uses_trigger:
            return
        if self.sms == 5:
            self.r["SR"] |= 0x40
            self.look_whether_it_counts()
        elif level:
            self.trigger_edge()

    def trigger_edge(self) -> None:
        if self.ts <= 4:
            for n in range(4):
                if self.is_on(n) and self.ccmr(n) & 3 == 3:
                    self.capture_edge(n)
        if self.sms == 4:
            self.reinitialize()
        elif self.sms == 6:
            self.r["CR1"] |= 1
            self.look_whether_it_counts()
        elif self.sms == 7 and not self.r["SMCR"] & 1 << 14 and self.may_count():
            self.clock()
        if self.sms:
            self.r["SR"] |= 0x40
        if self.is_advanced and self.r["CR2"] & 5 == 5:
            self.commutate()

    def changed(self, n: int) -> None:
        level = self.inputs[n].out
        if n == 4:
            if self.r["SMCR"] & 1 << 14 and level and self.may_count():
                self.clock()
            self.take_trigger()
            return
        for channel, source in ((n, 1), (n ^ 1, 2)):
            if self.is_on(channel) and self.ccmr(channel) & 3 == source and level != self.is_inverted(channel):
                self.capture_edge(channel)
        if self.is_encoder and n < 2:
            one, other = (self.inputs[k].out != self.is_inverted(k) for k in (0, 1))
            self.down = (one == other) if n == 0 else (one != other)
            if self.sms in {3, 2 - n} and self.may_count():  # 1: TI2, 2: TI1
                self.clock()
        if self.ts == 4 and n == 0 and self.uses_trigger:
            self.trigger_edge()
        else:
            self.take_trigger()

    def raw(self, n: int) -> bool:
        if n == 0 and self.r["CR2"] & 0x80:
            return self.levels[0] ^ self.levels[1] ^ self.levels[2]
        if n < 4:
            return self.levels[n]
        level = self.levels[7] != bool(self.r["SMCR"] & 1 << 15)
        division = self.field("SMCR", 12, 3)
        if not division:
            self.etr_was = level
            return level
        self.etr_edges += level and not self.etr_was
        self.etr_was = level
        return bool(self.etr_edges >> division - 1 & 1)

    def take_levels(self) -> None:
        for n, one in enumerate(self.inputs):
            if (7 if n == 4 else n) not in self.looked:
                continue
            level = self.raw(n)
            if level == one.raw:
                continue
            one.raw = level
            if one.length == 1:
                one.out = level
                self.changed(n)
            elif one.raw == one.out:
                one.run = 0

    def set_pin(self, which: int, level: bool) -> None:
        """Put a level on one of the pins."""
        self.levels[which] = level
        if which in self.looked:
            if 8 in self.looked and self.breaks() != self.in_break:
                self.check_break()
            self.take_levels()
        self.finish()

    def set_filters(self) -> None:
        for n, one in enumerate(self.inputs):
            mode = self.field("SMCR", 8, 15) if n == 4 else self.ccmr(n) >> 4 if self.is_input(n) else 0
            length, division, is_dts = FILTERS[mode]
            period = division << (min(self.field("CR1", 8, 3), 2) if is_dts else 0)
            if (length, period) == (one.length, one.period):
                continue
            one.length, one.period, one.run = length, period, 0
            if length == 1 and one.raw != one.out:
                one.out = one.raw
                self.changed(n)

    def wanted(self) -> set[int]:
        """The inputs from which something follows, as indices of `levels`."""
        wanted = {0, 1} if self.is_encoder else set()
        for n in range(4):
            if self.is_on(n) and self.ccmr(n) & 3 in {1, 2}:
                wanted.add(n if self.ccmr(n) & 3 == 1 else n ^ 1)
            if not self.is_input(n) and self.ccmr(n) & 0x80:
                wanted.add(7)
        if self.uses_trigger and self.ts >= 4:
            wanted.add({4: 0, 5: 0, 6: 1, 7: 7}[self.ts])
        wanted |= {7} if self.r["SMCR"] & 1 << 14 else set()
        if 0 in wanted and self.r["CR2"] & 0x80:
            wanted |= {0, 1, 2}
        if self.is_advanced and self.r["BDTR"] & 1 << 12:
            wanted.add(8)
        return wanted

    def listen(self) -> None:
        """What inputs are when they begin to matter is no edge."""
        wanted = self.wanted()
        fresh, self.looked = wanted - self.looked, wanted
        for n, one in enumerate(self.inputs):
            if (7 if n == 4 else n) in fresh:
                one.raw = one.out = self.raw(n)
                one.run = 0
        if fresh:
            self.trigger = self.trigger_level()

    # Break, modes.

    def breaks(self) -> bool:
        bdtr = self.r["BDTR"]
        return bool(bdtr & 1 << 12) and self.levels[8] == bool(bdtr & 1 << 13)

    def check_break(self) -> None:
        self.in_break = self.breaks()
        if self.in_break:
            self.trigger_break()

    def trigger_break(self) -> None:
        self.r["SR"] |= 0x80
        self.clear_moe()

    def clear_moe(self) -> None:
        if self.r["BDTR"] & 1 << 15:
            self.r["BDTR"] &= ~(1 << 15)
            self.idle_from = self.now + self.dead_time()

    def commutate(self) -> None:
        self.take_modes(is_commutation=True)
        self.r["SR"] |= 0x20

    def take_modes(self, *, is_commutation: bool = False) -> None:
        waits = bool(self.r["CR2"] & 1) and not is_commutation
        before = [self.reference(n) for n in range(4)]
        for n in range(4):
            bits = 0xF << 4 * n
            if waits and n < 3:
                bits &= ~(5 << 4 * n)
            self.ccer = self.ccer & ~bits | self.r["CCER"] & bits
            mode = self.ccmr(n) >> 4 & 7
            if (waits and n < 3) or mode == self.modes[n]:
                continue
            self.latched[n] = mode == 5 or (mode != 4 and before[n])
            self.modes[n] = mode
        for n in range(4):
            if not self.is_on(n):
                self.captured[n] = 0
            if not self.is_input(n) and not self.ccmr(n) & 8:
                self.ccr[n] = self.r[f"CCR{n + 1}"]

    # Outputs.

    def dead_time(self) -> int:
        dtg = self.r["BDTR"] & 0xFF
        if dtg < 0x80:
            steps = dtg
        elif dtg < 0xC0:
            steps = 2 * (64 + dtg % 64)
        else:
            steps = (8 if dtg < 0xE0 else 16) * (32 + dtg % 32)
        return steps << min(self.field("CR1", 8, 3), 2)

    def reference(self, n: int) -> bool:
        if self.cleared[n]:
            return False
        if self.modes[n] < 6:
            return self.latched[n]
        is_active = self.cnt <= self.ccr[n] if self.down else self.cnt < self.ccr[n]
        return is_active == (self.modes[n] == 6)

    def output(self, n: int, is_complement: bool) -> int:
        """LOW, HIGH or FLOATING."""
        bits = self.ccer >> 4 * n & 0xF
        if not self.is_advanced or n == 3:
            bits &= 3
        is_inverse = bool(bits & (8 if is_complement else 2))
        is_on, has_partner = (bits & 4, bits & 1) if is_complement else (bits & 1, bits & 4)
        bdtr, ois = self.r["BDTR"], self.r["CR2"] >> 8
        if self.is_input(n):
            return FLOATING
        if self.is_advanced and not bdtr & 1 << 15:
            if not bdtr & 1 << 10 or not bits & 5:
                return FLOATING
            idle = [bool(ois >> 2 * n & 1), n < 3 and bool(ois >> 2 * n & 2)]
            both = idle[0] != bool(bits & 2) and n < 3 and idle[1] != bool(bits & 8)
            return int(is_inverse if self.now < self.idle_from or both else idle[is_complement])
        if not is_on:
            return int(is_inverse) if has_partner and bdtr & 1 << 11 else FLOATING
        level = self.reference(n)
        if has_partner:
            level = level != is_complement
            if level and self.now < self.edge_at[n] + self.dead_time():
                level = False
        return int(level != is_inverse)

    def outputs(self) -> list[int]:
        """CH1 to CH4, CH1N to CH3N."""
        return [self.output(n, False) for n in range(4)] + [
            self.output(n, True) if self.is_advanced else FLOATING for n in range(3)
        ]

    def finish(self) -> None:
        """What follows from the state, after each clock and each access."""
        for n in range(4):
            if self.is_input(n) or not self.ccmr(n) & 0x80:
                self.cleared[n] = False
            elif self.inputs[4].out and not self.cleared[n]:
                self.cleared[n], self.latched[n] = True, False
        for n in range(3):
            if self.reference(n) != self.reference_was[n]:
                self.reference_was[n] = not self.reference_was[n]
                self.edge_at[n] = self.now
        level = False
        if self.mms == 1:
            level = bool(self.r["CR1"] & 1) and (self.sms != 5 or self.trigger)
        elif self.mms >= 4:
            level = self.reference(self.mms - 4)
        if level != self.trgo_level:
            self.trgo_level = level
            self.trgo.append((self.now, int(level)))

    def interrupts(self) -> list[bool]:
        active = self.r["SR"] & self.r["DIER"] & 0xFF
        if not self.is_advanced:
            return [bool(active)]
        return [bool(active & mask) for mask in (0x80, 0x01, 0x60, 0x1E)]

    # Registers.

    def read(self, name: str) -> int:
        if name == "CNT":
            return self.cnt
        if name == "CR1":
            return self.r["CR1"] & ~0x10 | self.down << 4
        if name.startswith("CCR") and self.is_input(int(name[3]) - 1):
            self.r["SR"] &= ~(2 << int(name[3]) - 1)
        return 0 if name == "EGR" else self.r[name]

    def kept(self, name: str) -> int:
        lock = self.lock or 0
        if name == "CR2":
            return 0x7F00 if lock >= 1 else 0
        if name == "BDTR":
            kept = 0 if self.lock is None else 0x300
            return kept | (0x70FF if lock >= 1 else 0) | (0xC00 if lock >= 2 else 0)
        kept = 0
        for n in range(4):
            if name == "CCER" and lock >= 2 and not self.is_input(n):
                kept |= 0xA << 4 * n
            if name == ("CCMR1" if n < 2 else "CCMR2"):
                kept |= (3 if self.r["CCER"] >> 4 * n & 1 else 0) << 8 * (n % 2)
                kept |= (0x78 if lock >= 3 and not self.is_input(n) else 0) << 8 * (n % 2)
        return kept

    def write(self, name: str, value: int) -> None:
        kind = 0 if self.is_advanced else 1
        special: dict[str, Callable[[int], None]] = {
            "SR": self.write_sr, "EGR": self.write_egr, "CNT": self.write_cnt, "BDTR": self.write_bdtr
        }  # fmt: skip
        if name in special and (name != "BDTR" or self.is_advanced):
            special[name](value)
        elif name in TAKEN:
            kept = self.kept(name)
            is_held = name.startswith("CCR") and self.is_input(int(name[3]) - 1)
            if not is_held:
                self.r[name] = value & TAKEN[name][kind] & ~kept | self.r[name] & kept
            self.take(name)
        if name in {"CR2", "SMCR", "CCMR1", "CCMR2", "CCER", "BDTR"}:
            self.listen()
            self.take_levels()
            self.trigger = self.trigger_level()
            self.look_whether_it_counts()
        self.finish()

    def take(self, name: str) -> None:
        if name in {"CR1", "ARR"} and not self.r["CR1"] & 0x80:
            self.arr = self.r["ARR"]
        if name == "CR1" and not self.r["CR1"] & 0x60 and not self.is_encoder:
            self.down = bool(self.r["CR1"] & 0x10)
        self.turn()
        if name in {"CR1", "ARR"}:
            self.look_whether_it_counts()
        if name in {"CR2", "CCMR1", "CCMR2", "CCER"}:
            self.take_modes()
        if name in {"CR1", "CR2", "SMCR", "CCMR1", "CCMR2", "CCER"}:
            self.set_filters()
        if name.startswith("CCR"):
            n = int(name[3]) - 1
            if not self.is_input(n) and not self.ccmr(n) & 8:
                self.ccr[n] = self.r[name]

    def write_sr(self, value: int) -> None:
        self.r["SR"] &= value | ~FLAGS[not self.is_advanced]
        if self.in_break:
            self.r["SR"] |= 0x80

    def write_cnt(self, value: int) -> None:
        self.cnt = value & 0xFFFF
        self.turn()

    def write_egr(self, value: int) -> None:
        for n in range(4):
            if value & 2 << n:
                (self.capture if self.is_input(n) else self.channel_event)(n)
        if value & 1:
            self.reinitialize()
        if value & 0x40:
            self.r["SR"] |= 0x40
        if value & 0x20 and self.is_advanced:
            self.commutate()
        if value & 0x80 and self.is_advanced:
            self.trigger_break()

    def write_bdtr(self, value: int) -> None:
        kept = self.kept("BDTR")
        if self.lock is None:
            self.lock = value >> 8 & 3
        before = self.r["BDTR"]
        self.r["BDTR"] = (value & ~kept | before & kept) & 0x7FFF | before & 0x8000
        self.listen()
        if not value & 0x8000 or self.breaks():
            self.clear_moe()
        else:
            self.r["BDTR"] |= 0x8000
        if self.breaks() != self.in_break:
            self.check_break()
