"""The host: a root port, frames and their transactions, control transfers, and enumeration.

Theory of operation. A pull-up that stays for 100 ms begins an enumeration: reset, the head of the device descriptor,
reset again, an address, all descriptors, the configuration, and for CDC ACM the settings of the line. Frames go on
from the first reset. In each the host has, in this order, what is periodic and due, the control transfer, and bulk
data in turn; a transaction that would not end within its frame waits for the next. After NAK it asks again at
multiples of `RETRY_NS`; since NAK changes nothing, the time up to the first answer that is another passes at once.
Three transactions in a row without an answer end the transfer, as on a real host.

    UNPLUGGED <-> WAITING -> DEBOUNCING -> ENUMERATING -> CONFIGURED <-> SUSPENDED
                     ^                         |  -> FAILED, after six attempts
                     +--- the pull-up goes ----+

Chosen: times of the root port are Linux's; one transaction of an endpoint is given or taken as it comes.
Not modelled: hubs, current, babble, isochronous data out, and other settings of interfaces than the first.
Source: USB 2.0 specification, sections 5, 8.5, 9; 7.1.7 for the port.
Invariant: `next_ns` is the time of the first thing to do, and never before the time reached.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import partialmethod

from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.usb_bus import (
    BETWEEN_BITS,
    FRAME_NS,
    FRAME_NUMBERS,
    TOKEN_BITS,
    BusState,
    Handshake,
    Token,
    Transaction,
    UsbResponse,
    span_ns,
    transaction_ns,
)
from bluepill_sim.parts.usb.descriptors import (
    CONFIGURATION_BYTES,
    DEVICE_BYTES,
    DescriptorError,
    DescriptorType,
    DeviceInfo,
    EndpointInfo,
    EndpointKind,
    InterfaceClass,
    packet_bytes_of,
    parse_configuration,
    parse_device,
    parse_string,
    total_bytes_of,
)
from bluepill_sim.parts.usb.pipes import Pipe, Request, TransferStage, UsbPacket
from bluepill_sim.peripherals.usb import Usb
from bluepill_sim.spans import Span
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: The port: how long a pull-up must stay, a reset lasts, a device has to recover from it, and from its address.
DEBOUNCE_NS, RESET_NS, RECOVERY_NS, ADDRESS_NS = 100 * NS_PER_MS, 50 * NS_PER_MS, 10 * NS_PER_MS, 10 * NS_PER_MS
#: chosen: a host takes so long from the head of the device descriptor to its second reset; the device has to be done.
HEAD_NS: Nanos = 1 * NS_PER_MS
#: How long the host signals a resume.
RESUME_NS: Nanos = 20 * NS_PER_MS
#: chosen: an endpoint that said NAK is asked again so often.
RETRY_NS: Nanos = 10_000
#: chosen: a host's controller takes so long to come to the status stage. Firmware that polls its USB, as examples of
#: libopencm3 do in a task, tells the end of the data and the status by their order, and relies on it.
STATUS_NS: Nanos = 50_000
#: 9.2.6: the longest that a request may take.
REQUEST_NS: Nanos = 5 * NS_PER_S
#: chosen: a host gives up after some two seconds, as Linux does; transactions in a row that nobody answers (8.6.2, 3).
_ATTEMPTS, _ERRORS, PAUSE_NS = 6, 3, 200 * NS_PER_MS
_ADDRESS = 5
_SOF_NS = span_ns(TOKEN_BITS + BETWEEN_BITS)
_LOOK_BYTES, _STRING_BYTES = 64, 255
#: Requests of chapter 9, of HID and of CDC.
GET_DESCRIPTOR, SET_ADDRESS, SET_CONFIGURATION = 6, 5, 9
SET_LINE_CODING, SET_CONTROL_LINE_STATE = 0x20, 0x22
_STANDARD_IN, _STANDARD_OUT, CLASS_TO_INTERFACE = 0x80, 0x00, 0x21
_ABSTRACT_CONTROL = 2
#: 115200 bit/s, a stop bit, no parity, 8 bits; DTR and RTS.
LINE_CODING = (115_200).to_bytes(4, "little") + bytes((0, 0, 8))
_DTR_RTS = 3
#: chosen: packets that nobody has taken; older ones are forgotten.
_KEPT_PACKETS = 4096


class HostState(Enum):
    """How far the host is with its device."""

    UNPLUGGED = "unplugged"
    #: Nothing pulls D+ up.
    WAITING = "waiting for a pull-up"
    DEBOUNCING = "debouncing"
    ENUMERATING = "enumerating"
    CONFIGURED = "configured"
    SUSPENDED = "suspended"
    FAILED = "failed"


class UsbRequestError(BluePillError):
    """A transfer failed: a STALL, silence, or no answer in time."""

    exit_code = 1


@dataclass(frozen=True, slots=True)
class _Running:
    """A transaction that has been answered and goes on to its end."""

    address: int
    transaction: Transaction
    answer: UsbResponse
    end_ns: Nanos
    #: Whether its last packet is lost on the way to the device, or on that to the host.
    device_misses_it: bool
    host_misses_it: bool


#: Runs the board until something is so, for as long as that at most; returns whether it is.
Wait = Callable[[Callable[[], bool], Span], bool]
#: Called with (address of the endpoint, its packet).
PacketSink = Callable[[int, UsbPacket], None]
#: Called with each transaction and what was answered, when it began.
TransactionSink = Callable[[Nanos, Transaction, UsbResponse | None], None]


class UsbHost(Stateful):
    """A host, and the cable to the board."""

    STATE = (
        "state", "device", "reason", "next_ns", "transactions", "_now_ns", "_frames_ns", "_frame", "_free_ns", "_timer",
        "_running", "_pipes", "_address", "_attempts", "_turn", "_todo", "_request", "_stage", "_taken", "_deadline_ns",
        "_answers", "_asked", "_packets", "_silenced", "_can_wake", "line_coding", "_is_open",
        "_is_set", "_line",
    )  # fmt: skip
    DERIVED = ("_packet_sinks", "_transaction_sinks", "_function")

    def __init__(self, function: Usb, wait: Wait) -> None:
        """Make one, whose cable is not plugged in.

        Args:
            function: the device at the other end.
            wait: brings the board forward, for what waits.
        """
        self._wait = wait
        self._function = function
        self._packet_sinks: list[PacketSink] = []
        self._transaction_sinks: list[TransactionSink] = []
        self.state = HostState.UNPLUGGED
        #: The device that was found.
        self.device: DeviceInfo | None = None
        #: Why an attempt failed last; empty: none has.
        self.reason = ""
        #: When the host acts next.
        self.next_ns: Nanos | None = None
        #: How many transactions there were but for those that said NAK.
        self.transactions = 0
        #: The settings of the line as SET_LINE_CODING has them.
        self.line_coding = LINE_CODING
        self._is_open = True
        self._now_ns: Nanos = 0
        self._frames_ns: Nanos | None = None
        self._frame = 0
        self._answers: dict[int, bytes | str] = {}
        self._asked = 0
        #: For the CDC line, until there is one.
        self._line = b""
        self._packets: deque[tuple[int, UsbPacket]] = deque(maxlen=_KEPT_PACKETS)
        self._silenced: deque[tuple[str, int]] = deque()
        self._clear()

    def _clear(self) -> None:
        """Forget the device; what waits to be sent is lost."""
        self.device = None
        self._free_ns: Nanos = 0
        #: What the port does next, and when.
        self._timer: tuple[Nanos, str] | None = None
        self._running: _Running | None = None
        self._pipes: dict[int, Pipe] = {}
        self._address = self._attempts = self._turn = 0
        self._todo: deque[Request] = deque()
        self._request: Request | None = None
        self._stage = TransferStage.SETUP
        self._taken = b""
        self._deadline_ns: Nanos | None = None
        self._can_wake = self._is_set = False

    # For users.

    def plug(self) -> None:
        """Plug the cable in."""
        if self.state is HostState.UNPLUGGED:
            self.state = HostState.WAITING
            self._function.heed_pull_up(True)
            self._changed()

    def unplug(self) -> None:
        """Pull the cable."""
        self._catch_up()
        self._abandon("the cable was pulled")
        self._line = b""
        self._stop_frames(BusState.IDLE)
        self._clear()
        self.state = HostState.UNPLUGGED
        self._function.heed_pull_up(False)
        self._changed()

    def reset(self) -> None:
        """Reset the bus and enumerate anew.

        Raises:
            UsbRequestError: there is no device.
        """
        self._expect_device()
        self._catch_up()
        self._abandon("the bus was reset")
        self._clear()
        self._begin_reset("look")
        self._changed()

    def suspend(self, *, may_wake: bool = False) -> None:
        """Stop the frames; the device sees it 3 ms later.

        Args:
            may_wake: whether a resume that the device signals counts.

        Raises:
            UsbRequestError: there is no configured device.
        """
        self._expect_device()
        self._catch_up()
        self._can_wake = may_wake
        self._running = None
        self._stop_frames(BusState.IDLE)
        self.state = HostState.SUSPENDED
        self._changed()

    def resume(self) -> None:
        """Signal a resume, and go on with frames 20 ms later."""
        self._catch_up()
        if self.state is HostState.SUSPENDED and self._timer is None:
            self._tell(BusState.RESUME)
            self._timer = self._now_ns + RESUME_NS, "resumed"
            self._changed()

    def wait_configured(self, within: Span = "2 s") -> DeviceInfo:
        """Plug the cable in and run the board until the device is configured; return what it is.

        Raises:
            UsbRequestError: it failed, or took longer.
        """
        self.plug()
        ends = {HostState.CONFIGURED, HostState.FAILED}
        self._wait(lambda: self.state in ends, within)
        if self.state is not HostState.CONFIGURED or self.device is None:
            why = f": {self.reason}" if self.reason else ""
            raise UsbRequestError(f"the USB device is not configured, it is {self.state.value}{why}")
        return self.device

    def transfer(
        self, kind: int, request: int, value: int = 0, index: int = 0, data: bytes = b"", *, length: int = 0,
        within: Span = "1 s",
    ) -> bytes:  # fmt: skip
        """Make a control transfer by hand, run the board until it has ended, and return what came.

        Args:
            kind: bmRequestType; with 0x80 the data stage is IN.
            request: bRequest.
            value: wValue.
            index: wIndex.
            data: what is sent.
            length: how many bytes are asked for.
            within: the longest wait.

        Raises:
            UsbRequestError: there is no device, it stalled, or it did not answer in time.
        """
        self._expect_device()
        self._catch_up()
        self._asked += 1
        number = self._asked
        self._todo.append(Request(kind, request, value, index, data, length, number=number))
        self._changed()
        self._wait(lambda: number in self._answers, within)
        answer = self._answers.pop(number, "no answer in time")
        if isinstance(answer, str):
            raise UsbRequestError(f"control transfer {kind:#04x} {request:#04x}: {answer}")
        return answer

    def write(self, endpoint: int, data: bytes) -> None:
        """Send data to an OUT endpoint, such as 0x01, in packets; a short packet is last only where the data end so.

        Raises:
            UsbRequestError: the device has no such endpoint.
        """
        pipe = self._pipe(endpoint)
        self._catch_up()
        size = pipe.packet_bytes
        pipe.to_send.extend(data[at : at + size] for at in range(0, max(len(data), 1), size))
        self._changed()

    def listen(self, endpoint: int) -> None:
        """Ask an IN endpoint, such as 0x81, for data from now on; those of CDC and HID are asked by themselves.

        Raises:
            UsbRequestError: the device has no such endpoint.
        """
        self._pipe(endpoint).is_listening = True
        self._changed()

    def read(self, endpoint: int) -> bytes:
        """Return and take what an endpoint has sent."""
        return b"".join(packet.data for packet in self.packets(endpoint))

    def packets(self, endpoint: int) -> list[UsbPacket]:
        """Return and take the packets that an endpoint has sent: the reports of a HID device, for one."""
        found = [packet for address, packet in self._packets if address == endpoint]
        left = [row for row in self._packets if row[0] != endpoint]
        self._packets.clear()
        self._packets.extend(left)
        return found

    def wait_packet(self, endpoint: int, within: Span = "1 s") -> UsbPacket:
        """Run the board until an endpoint has sent a packet that nobody has taken; take it.

        Raises:
            UsbRequestError: there is no such endpoint, or none came in time.
        """
        self.listen(endpoint)
        self._wait(lambda: any(address == endpoint for address, _ in self._packets), within)
        for row in self._packets:
            if row[0] == endpoint:
                self._packets.remove(row)
                return row[1]
        raise UsbRequestError(f"endpoint {endpoint:#04x} sent nothing in time; {self.describe()}")

    def clear_halt(self, endpoint: int) -> None:
        """Go on with an endpoint that has halted, from DATA0: what follows a CLEAR_FEATURE of ENDPOINT_HALT."""
        pipe = self._pipe(endpoint)
        pipe.halted, pipe.toggle, pipe.errors, pipe.nak_ns = "", 0, 0, None
        self._changed()

    def halted(self, endpoint: int) -> str:
        """Return why an endpoint has halted; empty: it has not."""
        return self._pipe(endpoint).halted

    def damage(self, what: str, transactions: int = 1, *, after: int = 0) -> None:
        """Have packets lost in some of the next transactions; those that say NAK count too.

        Args:
            what: "to device": what the host sends cannot be read; "to host": what the device answers; "ack": the
                handshake that ends it, whoever sends that.
            transactions: how many.
            after: how many are left whole before.

        Raises:
            ValueError: there is no such packet.
        """
        if what not in {"to device", "to host", "ack"}:
            raise ValueError(f"no packet {what!r}: to device, to host, or ack")
        self._silenced.extend((kind, count) for kind, count in (("", after), (what, transactions)) if count > 0)

    def describe(self) -> str:
        """Return in one line what is plugged in, for people."""
        name = "" if self.device is None else f"{self.device}, "
        why = f": {self.reason}" if self.reason and self.state is not HostState.CONFIGURED else ""
        halted = "".join(f", endpoint {p.address:#04x} {p.halted}" for p in self._pipes.values() if p.halted)
        return f"{name}{self.state.value}{why}{halted}"

    def subscribe_packets(self, sink: PacketSink) -> Callable[[], None]:
        """Have `sink` called with each packet that comes; return a function that ends it."""
        self._packet_sinks.append(sink)
        return lambda: self._packet_sinks.remove(sink)

    def subscribe_transactions(self, sink: TransactionSink) -> Callable[[], None]:
        """Have `sink` called with each transaction but those that say NAK; return a function that ends it."""
        self._transaction_sinks.append(sink)
        return lambda: self._transaction_sinks.remove(sink)

    # The line of a CDC device.

    @property
    def serial_out(self) -> int | None:
        """The OUT endpoint of the CDC line; None: the device has none."""
        return next((e.address for e in self._serial_endpoints() if not e.is_in), None)

    @property
    def serial_in(self) -> int | None:
        """Its IN endpoint."""
        return next((e.address for e in self._serial_endpoints() if e.is_in), None)

    def _serial_endpoints(self) -> list[EndpointInfo]:
        configuration = None if self.device is None else self.device.configuration
        if configuration is None or self.state not in {HostState.CONFIGURED, HostState.SUSPENDED}:
            return []
        data = [one for one in configuration.interfaces if one.kind == InterfaceClass.CDC_DATA]
        return [e for one in data[:1] for e in one.endpoints if e.kind is EndpointKind.BULK]

    def send_line(self, data: bytes) -> None:
        """Send data to the CDC line; they wait until the device is configured, and are lost when it goes."""
        self._line += data
        self._catch_up()
        self._send_line()

    def _send_line(self) -> None:
        out = self.serial_out
        if out is not None and self._line:
            line, self._line = self._line, b""
            self.write(out, line)

    # For the device.

    def device_changed(self, now_ns: Nanos) -> None:
        """Take that the device answers otherwise, or that its pull-up has come or gone."""
        self._now_ns = max(self._now_ns, now_ns)
        self._look_at_pull_up()
        self._plan()

    def wake(self, now_ns: Nanos) -> None:
        """Take that the suspended device signals a resume."""
        self._now_ns = max(self._now_ns, now_ns)
        if self._can_wake:
            self.resume()

    def advance_to(self, now_ns: Nanos) -> None:
        """Act on what is due."""
        while self.next_ns is not None and self.next_ns <= now_ns:
            self._now_ns = max(self._now_ns, self.next_ns)
            self._act()
            self._plan()
        self._now_ns = max(self._now_ns, now_ns)

    # What is next.

    def _restored(self) -> None:
        self._function.heed_pull_up(self.state is not HostState.UNPLUGGED)

    def _catch_up(self) -> None:
        """Come to the time that the board has reached: the user does something."""
        self._now_ns = max(self._now_ns, self._function.now_ns)

    def _changed(self) -> None:
        """Take that the user has done something."""
        self._catch_up()
        self._look_at_pull_up()
        self._plan()
        self._function.plan()

    def _plan(self) -> None:
        times = [self._timer and self._timer[0], self._deadline_ns]
        if self._running is not None:
            times.append(self._running.end_ns)
        elif (choice := self._choose()) is not None:
            times.append(choice[0])
        known = [time for time in times if time is not None]
        self.next_ns = max(min(known), self._now_ns) if known else None

    def _act(self) -> None:
        now_ns = self._now_ns
        if self._running is not None and self._running.end_ns <= now_ns:
            self._end(self._running)
        elif self._timer is not None and self._timer[0] <= now_ns:
            name, self._timer = self._timer[1], None
            getattr(self, _TIMERS[name])()
        elif self._deadline_ns is not None and self._deadline_ns <= now_ns:
            self._fail_request("no answer in 5 s")
        elif self._running is None and (choice := self._choose()) is not None and choice[0] <= now_ns:
            self._begin(choice[1])

    def _choose(self) -> tuple[Nanos, Pipe] | None:
        """Return the next transaction and its time: what is periodic first, then control, then bulk in turn."""
        if self._frames_ns is None:
            return None
        self._take_request()
        best: tuple[Nanos, int, Pipe] | None = None
        count = len(self._pipes)
        for place, pipe in enumerate(self._pipes.values()):
            if not (pipe.wants if pipe.address else self._request is not None):
                continue
            at_ns = self._earliest(pipe)
            if at_ns is None:
                continue
            order = 0 if pipe.is_periodic else 1 if pipe.address == 0 else 2 + (place - self._turn) % count
            if best is None or (at_ns, order) < best[:2]:
                best = at_ns, order, pipe
        return None if best is None else (best[0], best[2])

    def _earliest(self, pipe: Pipe) -> Nanos | None:
        """Return when a pipe may have its next transaction; None: not before the device changes."""
        frames_ns = self._frames_ns
        if frames_ns is None:
            return None
        if pipe.nak_ns is not None and not self._is_setup(pipe):
            if self._function.would_nak(pipe.address & 0xF, self._is_in_now(pipe)):
                return None
            self._ask_again(pipe, pipe.nak_ns)
        at_ns = max(self._now_ns, self._free_ns, pipe.not_before_ns, frames_ns + pipe.next_frame * FRAME_NS)
        return self._within_a_frame(at_ns, pipe.packet_bytes)

    def _ask_again(self, pipe: Pipe, nak_ns: Nanos) -> None:
        """Find out when a pipe is asked for the first time from now on, after it said NAK."""
        pipe.nak_ns = None
        if pipe.is_periodic:
            behind = max(0, self._frame_index() + 1 - pipe.next_frame)
            pipe.next_frame += -(-behind // pipe.interval_frames) * pipe.interval_frames
        else:
            pipe.not_before_ns = nak_ns + -(-(self._now_ns - nak_ns) // RETRY_NS) * RETRY_NS

    def _within_a_frame(self, at_ns: Nanos, packet_bytes: int) -> Nanos:
        """Return the first time from `at_ns` on where a transaction ends within its frame."""
        start_ns = self._frames_ns or 0
        into_ns = (at_ns - start_ns) % FRAME_NS
        if into_ns < _SOF_NS:
            return at_ns - into_ns + _SOF_NS
        if into_ns + transaction_ns(packet_bytes) > FRAME_NS:
            return at_ns - into_ns + FRAME_NS + _SOF_NS
        return at_ns

    # Transactions.

    def _begin(self, pipe: Pipe) -> None:
        now_ns = self._now_ns
        transaction = self._transaction(pipe)
        lost = self._next_damage()
        answer = self._function.begin(replace(transaction, is_damaged=lost == "to device"))
        if answer is not None and answer.handshake is Handshake.NAK and lost != "to host":
            self._take_nak(pipe)
            return
        self.transactions += 1
        for sink in self._transaction_sinks:
            sink(now_ns, transaction, None if lost == "to host" else answer)
        has_out = transaction.token is not Token.IN
        is_lost = lost == "to host" or (lost == "ack" and has_out)
        if answer is None or (is_lost and answer.handshake is not Handshake.ACK):
            self._free_ns = now_ns + transaction_ns(len(transaction.data), has_data=has_out, is_answered=False)
            self._take_silence(pipe)
            return
        data = transaction.data if has_out else answer.data
        has_handshake = answer.handshake is not None or pipe.kind is not EndpointKind.ISOCHRONOUS
        has_data = has_out or answer.handshake is None
        end_ns = now_ns + transaction_ns(len(data), has_data=has_data, has_handshake=has_handshake)
        self._free_ns = end_ns
        self._running = _Running(pipe.address, transaction, answer, end_ns, not has_out and lost == "ack", is_lost)

    def _transaction(self, pipe: Pipe) -> Transaction:
        number = pipe.address & 0xF
        if pipe.address == 0 and self._request is not None:
            if self._stage is TransferStage.SETUP:
                return Transaction(Token.SETUP, self._address, 0, 0, self._request.to_bytes())
            if self._is_in_now(pipe):
                return Transaction(Token.IN, self._address, 0)
            data = b""
            if self._stage is TransferStage.DATA:
                sent = len(self._taken)
                data = self._request.data[sent : sent + pipe.packet_bytes]
            return Transaction(Token.OUT, self._address, 0, pipe.toggle, data)
        if pipe.is_in:
            return Transaction(Token.IN, self._address, number)
        return Transaction(Token.OUT, self._address, number, pipe.toggle, pipe.to_send[0])

    def _is_setup(self, pipe: Pipe) -> bool:
        return pipe.address == 0 and self._stage is TransferStage.SETUP

    def _is_in_now(self, pipe: Pipe) -> bool:
        """Whether the next transaction of a pipe is IN: a status goes the other way than the data."""
        if pipe.address or self._request is None:
            return pipe.is_in
        return self._request.is_in is (self._stage is TransferStage.DATA)

    def _next_damage(self) -> str:
        if not self._silenced:
            return ""
        what, count = self._silenced[0]
        if count > 1:
            self._silenced[0] = what, count - 1
        else:
            self._silenced.popleft()
        return what

    def _take_nak(self, pipe: Pipe) -> None:
        now_ns = self._now_ns
        pipe.errors = 0
        pipe.nak_ns = now_ns
        if pipe.is_periodic:
            pipe.next_frame = self._frame_index() + pipe.interval_frames
        has_data = not self._is_in_now(pipe)
        size = min(len(pipe.to_send[0]) if pipe.to_send else 0, pipe.packet_bytes)
        self._free_ns = now_ns + transaction_ns(size, has_data=has_data)

    def _frame_index(self) -> int:
        return (self._now_ns - (self._frames_ns or 0)) // FRAME_NS

    def _take_silence(self, pipe: Pipe) -> None:
        pipe.errors += 1
        pipe.next_frame = self._frame_index() + pipe.interval_frames
        if pipe.errors >= _ERRORS:
            self._halt(pipe, "does not answer")

    def _end(self, running: _Running) -> None:
        """Take the end of a transaction that was answered."""
        self._running = None
        pipe, answer, transaction = self._pipes[running.address], running.answer, running.transaction
        if answer.handshake is not Handshake.STALL and not running.device_misses_it:
            self._function.end(transaction)
        if running.host_misses_it:
            self._take_silence(pipe)
            return
        pipe.errors, pipe.nak_ns = 0, None
        if pipe.is_periodic:
            pipe.next_frame = self._frame_index() + pipe.interval_frames
        if pipe.address:
            self._turn = (list(self._pipes).index(pipe.address) + 1) % len(self._pipes)
        if answer.handshake is Handshake.STALL:
            self._halt(pipe, "stalled")
        elif len(answer.data) > pipe.packet_bytes:
            self._halt(pipe, f"sent {len(answer.data)} bytes in a packet of {pipe.packet_bytes}")
        elif transaction.token is not Token.IN:
            pipe.toggle ^= 1
            self._sent(pipe, transaction)
        elif pipe.kind is EndpointKind.ISOCHRONOUS or answer.pid == pipe.toggle:
            pipe.toggle ^= 1
            self._take_data(pipe, answer.data)

    def _halt(self, pipe: Pipe, why: str) -> None:
        if pipe.address:
            pipe.halted = why
        else:
            pipe.errors = 0
            self._fail_request(why)

    def _take_data(self, pipe: Pipe, data: bytes) -> None:
        if pipe.address:
            packet = UsbPacket(self._now_ns, data)
            self._packets.append((pipe.address, packet))
            for sink in self._packet_sinks:
                sink(pipe.address, packet)
        elif self._stage is TransferStage.STATUS:
            self._end_request()
        elif self._request is not None:
            self._taken += data
            if len(data) < pipe.packet_bytes or len(self._taken) >= self._request.length:
                self._begin_status(pipe)

    def _sent(self, pipe: Pipe, transaction: Transaction) -> None:
        if pipe.address:
            pipe.to_send.popleft()
            return
        request = self._request
        if request is None:
            return
        if self._stage is TransferStage.STATUS:
            self._end_request()
        elif self._stage is TransferStage.SETUP:
            self._stage, pipe.toggle = TransferStage.DATA, 1
            if not (request.is_in or request.data):
                self._begin_status(pipe)
        else:
            self._taken += transaction.data
            if len(self._taken) >= len(request.data):
                self._begin_status(pipe)

    def _begin_status(self, pipe: Pipe) -> None:
        self._stage, pipe.toggle = TransferStage.STATUS, 1
        pipe.not_before_ns = self._now_ns + STATUS_NS

    # Control transfers.

    def _take_request(self) -> None:
        if self._request is None and self._todo and self._timer is None and 0 in self._pipes:
            self._request, self._stage, self._taken = self._todo.popleft(), TransferStage.SETUP, b""
            pipe = self._pipes[0]
            pipe.toggle, pipe.errors, pipe.nak_ns = 0, 0, None
            pipe.next_frame = self._frame_index() + 1  # its driver has to come to it first
            self._deadline_ns = self._now_ns + REQUEST_NS

    def _end_request(self) -> None:
        request, taken = self._request, self._taken
        self._request = self._deadline_ns = None
        if request is None:
            return
        if not request.purpose:
            self._answers[request.number] = taken[: request.length] if request.is_in else b""
            return
        try:
            getattr(self, _TAKERS[request.purpose])(taken[: request.length])
        except DescriptorError as error:
            self._attempt_again(str(error))
            return
        self._go_on()

    def _fail_request(self, why: str) -> None:
        request = self._request
        self._request = self._deadline_ns = self._running = None
        if request is None:
            return
        if not request.purpose:
            self._answers[request.number] = why
        elif request.purpose in _MAY_FAIL and why == "stalled":
            self._go_on()
        else:
            self._attempt_again(f"{request.purpose}: {why}")

    def _abandon(self, why: str) -> None:
        """Answer the requests by hand that will get no answer."""
        for request in (*([self._request] if self._request else []), *self._todo):
            if not request.purpose:
                self._answers[request.number] = why

    # The port.

    def _tell(self, state: BusState, frame: int = 0) -> None:
        self._function.bus_changed(state, self._now_ns, frame)

    def _stop_frames(self, state: BusState) -> None:
        if self._frames_ns is not None:
            self._frame = (self._frame + self._frame_index() + 1) % FRAME_NUMBERS
            self._frames_ns = None
        self._tell(state)

    def _start_frames(self) -> None:
        self._frames_ns = self._now_ns
        self._tell(BusState.FRAMES, self._frame)
        for pipe in self._pipes.values():
            pipe.next_frame, pipe.nak_ns, pipe.not_before_ns = 0, None, 0

    def _look_at_pull_up(self) -> None:
        is_there = self._function.is_attached
        if self.state is HostState.WAITING and is_there:
            self.state = HostState.DEBOUNCING
            self._timer = self._now_ns + DEBOUNCE_NS, "reset"
        elif self.state not in {HostState.UNPLUGGED, HostState.WAITING} and not is_there:
            self._abandon("the device has gone")
            self._stop_frames(BusState.IDLE)
            self._clear()
            self.reason, self._line = "", b""
            self.state = HostState.WAITING

    def _begin_reset(self, then: str) -> None:
        self.state = HostState.ENUMERATING
        self._running = None
        self._stop_frames(BusState.RESET)
        self._pipes.clear()
        self._address = 0
        self._timer = self._now_ns + RESET_NS, f"frames, then {then}"

    _reset_to_look = partialmethod(_begin_reset, "look")

    def _frames_begin(self, then: str) -> None:
        self._start_frames()
        self._timer = self._now_ns + RECOVERY_NS, then

    _frames_to_look = partialmethod(_frames_begin, "look")
    _frames_to_address = partialmethod(_frames_begin, "address")

    def _look(self) -> None:
        """Ask the device at address 0 for its descriptor: the head says how long packets are."""
        self._pipes[0] = Pipe(0, EndpointKind.CONTROL, _LOOK_BYTES)
        self._ask(DescriptorType.DEVICE, 0, _LOOK_BYTES, "head of the device descriptor")

    def _take_head(self, data: bytes) -> None:
        self._pipes[0] = Pipe(0, EndpointKind.CONTROL, packet_bytes_of(data))
        self._timer = self._now_ns + HEAD_NS, "reset again"

    def _reset_to_address(self) -> None:
        pipe = self._pipes[0]
        self._begin_reset("address")
        self._pipes[0] = pipe

    def _give_address(self) -> None:
        self._todo.append(Request(_STANDARD_OUT, SET_ADDRESS, _ADDRESS, purpose="address"))

    def _take_address(self, _data: bytes) -> None:
        self._address = _ADDRESS
        self._timer = self._now_ns + ADDRESS_NS, "describe"

    def _describe(self) -> None:
        self._ask(DescriptorType.DEVICE, 0, DEVICE_BYTES, "device descriptor")

    def _take_device(self, data: bytes) -> None:
        self.device = parse_device(data)
        self._ask(DescriptorType.CONFIGURATION, 0, CONFIGURATION_BYTES, "head of the configuration")

    def _take_configuration_head(self, data: bytes) -> None:
        self._ask(DescriptorType.CONFIGURATION, 0, total_bytes_of(data), "configuration descriptor")

    def _take_configuration(self, data: bytes) -> None:
        if self.device is None:
            return
        self.device = replace(self.device, configuration=parse_configuration(data))
        if any(self.device.strings):
            self._ask(DescriptorType.STRING, 0, _STRING_BYTES, "languages")

    def _take_languages(self, data: bytes) -> None:
        language = int.from_bytes(data[2:4], "little")
        for number, purpose in zip(self.device.strings if self.device else (), _STRINGS, strict=False):
            if number:
                self._ask(DescriptorType.STRING, number, _STRING_BYTES, purpose, language)

    def _take_nothing(self, data: bytes) -> None:
        """Go on: there was no answer but that it is done."""

    def _take_string(self, which: int, data: bytes) -> None:
        if self.device is not None:
            texts = {**self.device.texts, self.device.strings[which]: parse_string(data)}
            self.device = replace(self.device, texts=texts)

    _take_maker = partialmethod(_take_string, 0)
    _take_product = partialmethod(_take_string, 1)
    _take_serial_number = partialmethod(_take_string, 2)

    def _configured(self, _data: bytes) -> None:
        configuration = None if self.device is None else self.device.configuration
        self._is_set = True
        if configuration is None:
            return
        for one in configuration.interfaces:
            is_known = one.kind in set(InterfaceClass)
            for endpoint in one.endpoints:
                self._pipes[endpoint.address] = Pipe(
                    endpoint.address, endpoint.kind, endpoint.packet_bytes, endpoint.interval_frames,
                    is_listening=endpoint.is_in and is_known,
                )  # fmt: skip
            if one.kind == InterfaceClass.COMMUNICATIONS and one.subclass == _ABSTRACT_CONTROL:
                self._set_line(one.number)

    def _set_line(self, interface: int) -> None:
        state = _DTR_RTS if self._is_open else 0
        self._todo += (
            Request(CLASS_TO_INTERFACE, SET_LINE_CODING, 0, interface, self.line_coding, purpose="line coding"),
            Request(CLASS_TO_INTERFACE, SET_CONTROL_LINE_STATE, state, interface, purpose="line state"),
        )

    def set_line(self, coding: bytes | None = None, *, is_open: bool = True) -> None:
        """Set the line of a CDC device: SET_LINE_CODING and SET_CONTROL_LINE_STATE, now or when it is configured.

        Args:
            coding: the seven bytes; None keeps them.
            is_open: whether DTR and RTS are set, as of a port that a program has opened.
        """
        self.line_coding, self._is_open = coding or self.line_coding, is_open
        configuration = None if self.device is None else self.device.configuration
        if self.state is HostState.CONFIGURED and configuration is not None:
            for one in configuration.interfaces:
                if one.kind == InterfaceClass.COMMUNICATIONS and one.subclass == _ABSTRACT_CONTROL:
                    self._set_line(one.number)
            self._changed()

    def _go_on(self) -> None:
        """Go on with what the enumeration has left to do; the last is the configuration."""
        if self.state is not HostState.ENUMERATING or self._todo or self._timer is not None:
            return
        if self.device is not None and self.device.configuration is not None:
            if not self._is_set:
                self._todo.append(
                    Request(_STANDARD_OUT, SET_CONFIGURATION, self.device.configuration.value, purpose="configuration")
                )
            else:
                self.state, self.reason, self._attempts = HostState.CONFIGURED, "", 0
                self._send_line()

    def _ask(self, kind: DescriptorType, number: int, length: int, purpose: str, language: int = 0) -> None:
        value = kind << 8 | number
        self._todo.append(Request(_STANDARD_IN, GET_DESCRIPTOR, value, language, length=length, purpose=purpose))

    def _attempt_again(self, why: str) -> None:
        attempts = self._attempts + 1
        self._abandon(why)
        self._clear()
        self._attempts, self.reason = attempts, why
        self._stop_frames(BusState.IDLE)
        if attempts < _ATTEMPTS:
            self.state = HostState.ENUMERATING
            self._timer = self._now_ns + PAUSE_NS, "reset"
        else:
            self.state = HostState.FAILED

    def _resumed(self) -> None:
        self.state = HostState.CONFIGURED
        self._start_frames()

    # Helpers.

    def _expect_device(self) -> None:
        if self.state is not HostState.CONFIGURED:
            raise UsbRequestError(
                f"the USB device is not configured: {self.describe()}", hint="board.usb.wait_configured()"
            )

    def _pipe(self, endpoint: int) -> Pipe:
        if not endpoint & 0xF or endpoint not in self._pipes:
            there = ", ".join(f"{address:#04x}" for address in self._pipes if address) or "none"
            raise UsbRequestError(f"the USB device has no endpoint {endpoint:#04x}; it has {there}: {self.describe()}")
        return self._pipes[endpoint]


_STRINGS = ("maker", "product name", "serial number")
#: What the host does with the answer to each of its requests, and which a device need not know.
_TAKERS = {
    "head of the device descriptor": "_take_head",
    "address": "_take_address",
    "device descriptor": "_take_device",
    "head of the configuration": "_take_configuration_head",
    "configuration descriptor": "_take_configuration",
    "languages": "_take_languages",
    "maker": "_take_maker",
    "product name": "_take_product",
    "serial number": "_take_serial_number",
    "configuration": "_configured",
    "line coding": "_take_nothing",
    "line state": "_take_nothing",
}
_MAY_FAIL = {"languages", *_STRINGS, "line coding", "line state"}
_TIMERS = {
    "reset": "_reset_to_look",
    "reset again": "_reset_to_address",
    "frames, then look": "_frames_to_look",
    "frames, then address": "_frames_to_address",
    "look": "_look",
    "address": "_give_address",
    "describe": "_describe",
    "resumed": "_resumed",
}
