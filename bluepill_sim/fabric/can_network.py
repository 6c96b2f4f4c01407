"""A CAN: nodes that hear each other's frames, one at a time, the lowest identifier first.

Theory of operation. A frame begins when the bus is free and somebody wants to send: then all that want to arbitrate.
Who has won is worked out some bits later and told to every node with the time of the frame's end, which none has
reached yet: so chips that run one after the other, in steps shorter than that, agree whatever the order (`run`). The
length of a frame is that of its bits with their CRC and stuff bits.

Single bits are no business of the bus: a chip that somebody looks at works them out from `coming`.

Not modelled: overload frames, errors but those that `damage`, other bit rates and missing
acknowledges make, the resynchronisation of clocks that differ by less than `TOLERANCE`.
Source: ISO 11898-1 (Bosch CAN 2.0, part B).
Invariant: what is told to one node is told to all, in the order of the bus.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction
from functools import lru_cache
from typing import Protocol

from bluepill_sim.fabric.bus_parts import CanFrame
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: Bits behind the CRC: its delimiter, the acknowledge with its own, the end of the frame; between frames; of an error.
_TAIL_BITS, _BETWEEN_BITS, _ERROR_BITS, _SUSPEND_BITS = 10, 3, 14, 8
#: So long after its begin a frame is decided; `run` takes steps of half of that. The shortest has 44.
_DECIDED_BITS, STEP_BITS = 20, 10
#: How far bit rates of two ends may differ.
TOLERANCE = Fraction(15, 1000)
_CRC_POLYNOMIAL, _STUFF_AFTER = 0x4599, 5
#: The bit rate of a node that has none, where no other has one.
_USUAL_HZ = 500_000


class CanError(IntEnum):
    """What was wrong with a frame: LEC of who has sent it."""

    NONE = 0
    ACKNOWLEDGE = 3
    BIT_DOMINANT = 5


@dataclass(frozen=True, slots=True)
class CanEnd:
    """The end of a frame, as one node sees it."""

    #: When the frame began, and when it has ended.
    start_ns: Nanos
    end_ns: Nanos
    frame: CanFrame
    is_own: bool
    error: CanError


class CanMember(Protocol):
    """A node, as the network sees it."""

    @property
    def now_ns(self) -> Nanos | None:
        """The time that it has reached; None: it has no clock."""

    @property
    def bit_rate(self) -> Fraction | None:
        """Bits a second; None: whatever the others have."""

    @property
    def acknowledges(self) -> bool:
        """Whether it hears frames of others and drives the bus."""

    @property
    def hears_itself(self) -> bool:
        """Whether its own frames need nobody else."""

    @property
    def is_passive(self) -> bool:
        """Whether it waits longer behind a frame of its own."""

    def offer(self, at_ns: Nanos) -> CanFrame | None:
        """Return what it wants to send at a time."""

    def lose(self, at_ns: Nanos) -> bool:
        """Take that another has won; return whether it tries again."""

    def end(self, end: CanEnd) -> None:
        """Take the end of a frame, which is still to come."""

    def plan(self) -> None:
        """Take that `next_ns` of the network has changed."""


class ChipRunner(Protocol):
    """What brings a chip forward."""

    @property
    def now_ns(self) -> Nanos:
        """The time reached."""

    def advance_to(self, limit_ns: Nanos) -> object:
        """Run to a time."""


class CanNetwork(Stateful):
    """A bus and who is on it."""

    STATE = ("_free_ns", "_wanted", "_damaged", "late", "_parts")
    #: Who has joined; each is made before a state is put back.
    DERIVED = ("_members",)

    def __init__(self) -> None:
        self._members: list[CanMember] = []
        #: The nodes that are parts, for snapshots; chips save themselves.
        self._parts: list[Stateful] = []
        self._free_ns: Nanos = 0
        #: Since when each member wants to send.
        self._wanted: dict[int, Nanos] = {}
        self._damaged = 0
        #: Frames whose end a chip had passed already: chips were not brought forward by `run`.
        self.late = 0

    def join(self, member: CanMember) -> None:
        """Put a node on the bus."""
        self._members.append(member)
        if isinstance(member, CanNode):
            self._parts.append(member)
            member.network = self

    def damage(self, frames: int = 1) -> None:
        """Have the next frames damaged: who sends one sees an error and tries again."""
        self._damaged += frames

    @property
    def now_ns(self) -> Nanos:
        """The latest time that a chip has reached; without chips, when the bus is free."""
        times = [member.now_ns for member in self._members if member.now_ns is not None]
        return max(times, default=self._free_ns)

    @property
    def next_ns(self) -> Nanos | None:
        """When the next frame is decided; None: nobody wants to send."""
        start_ns = self.start_ns
        return None if start_ns is None else start_ns + self._span_ns(_DECIDED_BITS, self._rate())

    @property
    def start_ns(self) -> Nanos | None:
        """When the next frame begins, or began that is not decided; None: nobody wants to send."""
        return max(self._free_ns, min(self._wanted.values())) if self._wanted else None

    def coming(self) -> "tuple[CanMember, CanFrame, CanError] | None":
        """Return who will have won with which frame that begins at `start_ns`, and what will be wrong with it.

        None: nobody sends, or it cannot be known yet, since several chips have clocks of their own.
        """
        start_ns = self.start_ns
        if start_ns is None or sum(member.now_ns is not None for member in self._members) > 1:
            return None
        ready = {n: self._members[n].offer(start_ns) for n, at_ns in self._wanted.items() if at_ns <= start_ns}
        offered = [(_arbitration_bits(frame), n, frame) for n, frame in ready.items() if frame is not None]
        if not offered:
            return None
        _, n, frame = min(offered, key=lambda one: one[:2])
        member = self._members[n]
        others = [one for one in self._members if one is not member]
        error = CanError.NONE if member.hears_itself else self._error_of(others, member.bit_rate or self._rate())
        return member, frame, error

    def want(self, member: CanMember, at_ns: Nanos) -> None:
        """Take that a node wants to send from a time on."""
        self._wanted.setdefault(self._members.index(member), at_ns)
        self._replan()

    def forget(self, member: CanMember) -> None:
        """Take that a node wants to send no more: a frame of its own that is not decided does not go out."""
        if self._wanted.pop(self._members.index(member), None) is not None:
            self._replan()

    def put(self, member: CanMember, wanted_ns: Nanos | None, free_ns: Nanos) -> None:
        """Put down since when the only node wants to send, if it does, and when the bus is free: it has kept both."""
        self._wanted = {} if wanted_ns is None else {self._members.index(member): wanted_ns}
        self._free_ns = free_ns

    def advance_to(self, now_ns: Nanos) -> None:
        """Decide the frames that are due."""
        while (due_ns := self.next_ns) is not None and due_ns <= now_ns:
            self._decide()

    def run(self, boards: Sequence[ChipRunner], until_ns: Nanos) -> None:
        """Bring boards forward together, in steps that are short enough for this bus."""
        while (now_ns := min(board.now_ns for board in boards)) < until_ns:
            step_ns = now_ns + max(1, self._span_ns(STEP_BITS, self._rate()))
            for board in boards:
                board.advance_to(min(until_ns, step_ns))

    def _rate(self) -> Fraction:
        rates = [rate for member in self._members if (rate := member.bit_rate) is not None]
        return max(rates, default=Fraction(_USUAL_HZ))

    def _decide(self) -> None:
        start_ns = self.start_ns
        if start_ns is None:
            return
        ready = {n: self._members[n].offer(start_ns) for n, at_ns in self._wanted.items() if at_ns <= start_ns}
        offered = {n: frame for n, frame in ready.items() if frame is not None}
        for n in ready.keys() - offered.keys():
            del self._wanted[n]
        if not offered:
            self._replan()
            return
        sender = min(offered, key=lambda n: (_arbitration_bits(offered[n]), n))
        for n in offered:
            if n == sender or not self._members[n].lose(start_ns):
                del self._wanted[n]
        self._send(sender, offered[sender], start_ns)

    def _send(self, sender: int, frame: CanFrame, start_ns: Nanos) -> None:
        member = self._members[sender]
        rate = member.bit_rate or self._rate()
        others = [one for one in self._members if one is not member]
        error = CanError.NONE
        if not member.hears_itself:
            error = self._error_of(others, rate)
            self._damaged -= bool(self._damaged)
        length = stuffed_bits(frame) + (_TAIL_BITS if error is CanError.NONE else _ERROR_BITS)
        end_ns = start_ns + self._span_ns(length, rate)
        pause = _BETWEEN_BITS + (_SUSPEND_BITS if member.is_passive else 0)
        self._free_ns = start_ns + self._span_ns(length + pause, rate)
        self.late += any(one.now_ns is not None and one.now_ns > end_ns for one in self._members)
        for one in self._members:
            one.end(CanEnd(start_ns, end_ns, frame, one is member, error))
        self._replan()

    def _error_of(self, others: Sequence[CanMember], rate: Fraction) -> CanError:
        active = [one for one in others if one.acknowledges]
        strange = [one for one in active if one.bit_rate is not None and abs(one.bit_rate / rate - 1) > TOLERANCE]
        if self._damaged or strange:
            return CanError.BIT_DOMINANT
        return CanError.NONE if active else CanError.ACKNOWLEDGE

    @staticmethod
    def _span_ns(bits: int, rate: Fraction) -> Nanos:
        return bits * NS_PER_S * rate.denominator // rate.numerator  # a tenth of the time that a Fraction takes

    def _replan(self) -> None:
        for member in self._members:
            member.plan()


class CanNode(Stateful):
    """A node in Python: it sends what it is told to, and keeps what it hears."""

    STATE = ("received", "errors", "_coming")

    def __init__(self, on_frame: Callable[[CanFrame, Nanos], None] | None = None, *, is_silent: bool = False) -> None:
        """Make one.

        Args:
            on_frame: called with each frame of others and the time of its end, which is the time to send an answer at.
            is_silent: whether it only listens, and acknowledges nothing.
        """
        self.on_frame, self.is_silent = on_frame, is_silent
        #: Called with each frame of its own that has gone over, and the time of its end.
        self.on_sent: Callable[[CanFrame, Nanos], None] | None = None
        self.network: CanNetwork | None = None
        #: Frames of others, with their ends.
        self.received: list[tuple[Nanos, CanFrame]] = []
        #: Frames of its own that were damaged or not acknowledged; it tries each again.
        self.errors = 0
        self._coming: list[tuple[Nanos, CanFrame]] = []

    def send(self, frame: CanFrame, at_ns: Nanos | None = None) -> None:
        """Send a frame from a time on, behind those before it; None is now.

        Raises:
            ValueError: It is on no network.
        """
        if self.network is None:
            raise ValueError("the node is on no network: let it join one first")
        begin_ns = self.network.now_ns if at_ns is None else at_ns
        self._coming.append((begin_ns, frame))
        self.network.want(self, self._coming[0][0])

    @property
    def waiting(self) -> int:
        """How many of its own frames have not gone over."""
        return len(self._coming)

    @property
    def now_ns(self) -> Nanos | None:
        """None: it has no clock."""
        return None

    @property
    def bit_rate(self) -> Fraction | None:
        """None: that of the others."""
        return None

    @property
    def acknowledges(self) -> bool:
        """Whether it acknowledges."""
        return not self.is_silent

    @property
    def hears_itself(self) -> bool:
        """False: it is on the bus."""
        return False

    @property
    def is_passive(self) -> bool:
        """False: it counts no errors."""
        return False

    def offer(self, at_ns: Nanos) -> CanFrame | None:
        """Return the first frame, if its time has come."""
        return self._coming[0][1] if self._coming and self._coming[0][0] <= at_ns else None

    def lose(self, at_ns: Nanos) -> bool:
        """Try again."""
        del at_ns
        return True

    def plan(self) -> None:
        """Nothing to plan."""

    def end(self, end: CanEnd) -> None:
        """Keep what others have sent; go on with the next of its own."""
        if end.is_own:
            if end.error is CanError.NONE:
                self._coming.pop(0)
                if self.on_sent is not None:
                    self.on_sent(end.frame, end.end_ns)
            else:
                self.errors += 1
            if self._coming and self.network is not None:
                self.network.want(self, max(end.end_ns, self._coming[0][0]))
        elif end.error is CanError.NONE:
            self.received.append((end.end_ns, end.frame))
            if self.on_frame is not None:
                self.on_frame(end.frame, end.end_ns)


@lru_cache(maxsize=256)  # a frame that nobody acknowledges is sent again and again
def stuffed_bits(frame: CanFrame) -> int:
    """Return how many bits a frame has from its start to the end of its CRC, with stuff bits."""
    return len(frame_bits(frame))


def frame_bits(frame: CanFrame) -> list[int]:
    """Return the bits of a frame from its start to the end of its CRC, with stuff bits; 0 is dominant."""
    bits = [0, *_arbitration_bits(frame)]
    if frame.is_extended:
        bits += [0, 0]
    else:
        bits += [0]
    bits += [frame.dlc >> n & 1 for n in (3, 2, 1, 0)]
    bits += [byte >> n & 1 for byte in frame.data for n in range(7, -1, -1)]
    crc = 0
    for bit in bits:
        crc = (crc << 1 ^ (_CRC_POLYNOMIAL if bit ^ crc >> 14 else 0)) & 0x7FFF
    bits += [crc >> n & 1 for n in range(14, -1, -1)]
    stuffed: list[int] = []
    run, last = 0, None
    for bit in bits:
        stuffed.append(bit)
        run = run + 1 if bit == last else 1
        last = bit
        if run == _STUFF_AFTER:
            stuffed.append(1 - bit)
            run, last = 1, 1 - bit
    return stuffed


def _arbitration_bits(frame: CanFrame) -> tuple[int, ...]:
    """Return the bits that decide who sends, from the identifier to IDE or RTR; 0 is dominant."""
    if not frame.is_extended:
        return (*(frame.identifier >> n & 1 for n in range(10, -1, -1)), int(frame.is_remote), 0)
    identifier = [frame.identifier >> n & 1 for n in range(28, -1, -1)]
    return (*identifier[:11], 1, 1, *identifier[11:], int(frame.is_remote))
