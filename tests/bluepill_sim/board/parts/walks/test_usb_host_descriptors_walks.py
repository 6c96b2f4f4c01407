"""A USB host and devices that answer at random: every transaction, state and refusal, as approved."""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from bluepill_sim.fabric.usb_bus import BusState, Handshake, Token, Transaction, UsbResponse, span_ns, transaction_ns
from bluepill_sim.parts.usb.descriptors import (
    packet_bytes_of,
    parse_configuration,
    parse_device,
    parse_string,
    total_bytes_of,
)
from bluepill_sim.parts.usb.host import UsbHost
from bluepill_sim.parts.usb.pipes import Pipe, Request
from bluepill_sim.parts.usb.serial import UsbSerial
from tests.tools.suite.approved import Trace, judge_of, said, tried

MS = 1_000_000
DEVICE = bytes.fromhex("12010002020000400912010001020102 0301".replace(" ", ""))
ENDPOINTS = {
    "bulk": ("0705020240 0000", "0705820240 0000"),
    "notify": ("0705810308 0010",),
    "isochronous": ("0705830164 0003", "0705030164 0001"),
    "hid": ("0705850308 0004", "0705050308 000a"),
}


def interface(number: int, kind: int, subclass: int, *endpoints: str, setting: int = 0) -> bytes:
    head = bytes((9, 4, number, setting, len(endpoints), kind, subclass, 1, 0))
    return head + b"".join(bytes.fromhex(each.replace(" ", "")) for each in endpoints)


def configuration(*interfaces: bytes) -> bytes:
    body = b"".join(interfaces)
    return bytes((9, 2, *(9 + len(body)).to_bytes(2, "little"), len(interfaces), 1, 0, 0x80, 50)) + body


CDC = configuration(
    interface(0, 2, 2, *ENDPOINTS["notify"]) + bytes((5, 0x24, 0, 16, 1)), interface(1, 10, 0, *ENDPOINTS["bulk"])
)
MIXED = configuration(
    interface(0, 3, 0, *ENDPOINTS["hid"]),
    interface(1, 0xFF, 0, *ENDPOINTS["bulk"]),
    interface(1, 0xFF, 0, *ENDPOINTS["bulk"], setting=1),
    interface(2, 1, 2, *ENDPOINTS["isochronous"]),
)


def text(words: str) -> bytes:
    return bytes((2 + 2 * len(words), 3)) + words.encode("utf-16-le")


@dataclass
class Device:
    """A function that answers the host by tables and by chance, and writes down what it is lines."""

    draw: random.Random
    configuration: bytes = CDC
    device: bytes = DEVICE
    strings: dict[int, bytes] = field(
        default_factory=lambda: {0: bytes((4, 3, 9, 4)), 1: text("p2os"), 2: text("a ß"), 3: text("007")}
    )
    #: How often it says NAK, STALL or nothing, where it need not.
    moods: tuple[float, float, float] = (0.0, 0.0, 0.0)
    now_ns: int = 0
    is_attached: bool = True
    lines: list[str] = field(default_factory=list)
    _answer: bytes = b""
    _toggle: int = 1
    _toggles: dict[int, int] = field(default_factory=dict)
    to_send: dict[int, list[bytes]] = field(default_factory=dict)

    def heed_pull_up(self, heeds: bool) -> None:
        self.lines.append(f"heeds {heeds}")

    def plan(self) -> None:
        self.lines.append("plan")

    def bus_changed(self, state: BusState, now_ns: int, frame: int) -> None:
        self.lines.append(f"{now_ns} {state.name} {frame}")
        if state is BusState.RESET:
            self._toggles.clear()

    def would_nak(self, endpoint: int, is_in: bool) -> bool:
        return is_in and endpoint != 0 and not self.to_send.get(endpoint)

    def begin(self, one: Transaction) -> UsbResponse | None:
        mood, (naks, stalls, silences) = self.draw.random(), self.moods
        if mood < silences or one.is_damaged:
            return None
        if mood < silences + stalls + naks and one.token is not Token.SETUP:
            return UsbResponse(Handshake.STALL if mood < silences + stalls else Handshake.NAK)
        if one.token is Token.SETUP:
            self._answer, self._toggle = self._asked(one.data), 1
        if one.token is not Token.IN:
            return UsbResponse(Handshake.ACK)
        if one.endpoint == 0:
            packet = self.device[7] or 8
            return UsbResponse(None, self._toggle, self._answer[:packet])
        waiting = self.to_send.get(one.endpoint)
        if not waiting:
            return UsbResponse(Handshake.NAK)
        return UsbResponse(None, self._toggles.get(one.endpoint, 0), waiting[0])

    def end(self, one: Transaction) -> None:
        if one.token is Token.IN and one.endpoint == 0:
            self._answer, self._toggle = self._answer[self.device[7] or 8 :], self._toggle ^ 1
        elif one.token is Token.IN and self.to_send.get(one.endpoint):
            self.to_send[one.endpoint].pop(0)
            self._toggles[one.endpoint] = self._toggles.get(one.endpoint, 0) ^ 1

    def _asked(self, setup: bytes) -> bytes:
        kind, request, number, which = setup[0], setup[1], setup[2], setup[3]
        length = int.from_bytes(setup[6:8], "little")
        if kind == 0x80 and request == 6:
            found = {1: self.device, 2: self.configuration, 3: self.strings.get(number, b"")}.get(which, b"")
            return found[:length]
        return bytes(range(length)) if kind & 0x80 else b""


class Bench:
    """A host at a device, and the time."""

    def __init__(self, device: Device) -> None:
        self.device, self.end_ns = device, 0
        self.host = UsbHost(device, self.wait)  # type: ignore[arg-type]
        self.packets: list[str] = []
        self.host.subscribe_packets(
            lambda address, packet: self.packets.append(f"{packet.at_ns} {address:x} {packet.data.hex()}")
        )
        self.host.subscribe_transactions(self._took)

    def _took(self, ns: int, one: Transaction, answer: UsbResponse | None) -> None:
        got = (
            "-"
            if answer is None
            else answer.handshake.name
            if answer.handshake
            else f"{answer.pid} {answer.data.hex()}"
        )
        self.device.lines.append(f"{ns} {one.token.name} {one.address}.{one.endpoint} {one.pid} {one.data.hex()} {got}")

    def wait(self, is_so: Callable[[], bool], within: object) -> bool:
        ends = self.device.now_ns + (2_500 * MS if within == "2 s" else 700 * MS)
        for _ in range(3000):
            if is_so():
                return True
            due = self.host.next_ns
            if due is None or due > ends:
                break
            self.device.now_ns = max(self.device.now_ns, due)
            self.host.advance_to(self.device.now_ns)
        self.device.now_ns = max(self.device.now_ns, ends)
        self.host.advance_to(ends)
        return is_so()

    def go_on(self, ns: int) -> None:
        ends = self.device.now_ns + ns
        for _ in range(400):
            due = self.host.next_ns
            if due is None or due > ends:
                break
            self.device.now_ns = max(self.device.now_ns, due)
            self.host.advance_to(due)
        self.device.now_ns = ends
        self.host.advance_to(ends)

    def seen(self) -> str:
        host, device = self.host, self.device
        kept = {name: value for name, value in host.snapshot().items() if name not in {"device", "_packets"}}
        found = said([host.describe(), host.device, host.next_ns, kept, len(host._packets), self.packets])
        lines = " / ".join(device.lines)
        device.lines.clear()
        self.packets.clear()
        return f"{lines} | {found}"


def enumerations(draw: random.Random) -> Iterator[str]:
    short = DEVICE[:7] + b"\x08" + DEVICE[8:]
    devices = (
        Device(draw),
        Device(draw, MIXED, short),
        Device(draw, CDC, DEVICE[:14] + bytes(3) + b"\1"),
        Device(draw, CDC, DEVICE[:14] + b"\0\2\0\1"),
        Device(draw, CDC[:-2]),
        Device(draw, b"", DEVICE),
        Device(draw, CDC, DEVICE[:7] + b"\x09" + DEVICE[8:]),
        Device(draw, CDC, DEVICE[:17] + b"\0"),
        Device(draw, CDC, b"\0" * 18),
        Device(draw, configuration()),
        Device(draw, MIXED, DEVICE, {}),
        Device(draw, moods=(0.3, 0.0, 0.0)),
        Device(draw, moods=(0.1, 0.0, 0.15)),
        Device(draw, moods=(0.1, 0.1, 0.0)),
        Device(draw, MIXED, moods=(0.0, 0.0, 1.0)),
    )
    for device in devices:
        bench = Bench(device)
        bench.device.is_attached = draw.random() < 0.5
        bench.host.plug()
        bench.go_on(3 * MS)
        device.is_attached = True
        bench.host.device_changed(device.now_ns)
        yield bench.seen()
        yield tried(bench.host.wait_configured) + bench.seen()
        bench.go_on(draw.choice((0, 2 * MS)))
        yield said([bench.host.serial_in, bench.host.serial_out, bench.host.transactions])


def sessions(draw: random.Random) -> Iterator[str]:
    moods = ((0.0, 0.0, 0.0), (0.3, 0.0, 0.02), (0.2, 0.02, 0.05))
    for layout, mood in ((CDC, moods[0]), (MIXED, moods[0]), (CDC, moods[1]), (MIXED, moods[2])):
        yield from session(Bench(Device(draw, layout, moods=mood)), draw)


def session(bench: Bench, draw: random.Random) -> Iterator[str]:
    lines = bench.device.lines
    line = UsbSerial(bench.host, lambda *_: None, lambda: lines.append("stop"))
    end = line.subscribe(lambda rows: lines.append(f"line {said([*rows][:3])}"), ends_slice=True)
    line.receive(b"before")
    bench.host.set_line(bytes((1, 2, 3, 4, 5, 6, 7)), is_open=draw.random() < 0.5)
    yield tried(bench.host.wait_configured) + bench.seen()
    moves = _moves(bench, line, draw)
    for step in range(140):
        if not step % 7:  # whatever came before, it is there again
            bench.device.is_attached = True
            bench.host.plug()
            bench.host.device_changed(bench.device.now_ns)
            bench.host.resume()
            bench.go_on(800 * MS)
        name = draw.choice((*moves, "go on", "go on", "data", "data"))
        did, counts = tried(moves[name]), (line.received_bytes, line.sent_bytes, line.read().hex())
        yield f"{name} {did} {bench.seen()} {said(counts)}"
    end()
    yield tried(bench.host.read, 0x82) + tried(bench.host.unplug) + bench.seen()


def _moves(bench: Bench, line: UsbSerial, draw: random.Random) -> dict[str, Callable[[], object]]:
    host, device = bench.host, bench.device

    def data() -> str:
        endpoint = draw.choice((2, 2, 1, 3, 5))
        size = draw.choice((0, 1, 8, 9, 63, 64, 65, 100))
        device.to_send.setdefault(endpoint, []).append(bytes(n & 0xFF for n in range(size)))
        host.device_changed(device.now_ns)
        bench.go_on(draw.choice((100_000, MS, 12 * MS)))
        return f"{endpoint} {size}"

    def attach() -> str:
        device.is_attached = draw.random() < 0.7
        host.device_changed(device.now_ns)
        bench.go_on(draw.choice((MS, 400 * MS)))
        return f"{device.is_attached}"

    def transfer() -> bytes:
        kind = draw.choice((0x80, 0x21, 0xA1, 0x00))
        return host.transfer(
            kind,
            draw.choice((0, 6, 9, 0x20)),
            draw.choice((0, 0x100, 0x201)),
            0,
            draw.choice((b"", b"abc", bytes(70))) if not kind & 0x80 else b"",
            length=draw.choice((0, 2, 18, 70)) if kind & 0x80 else 0,
        )

    return {
        "go on": lambda: bench.go_on(draw.choice((20_000, 900_000, MS, 5 * MS, 60 * MS))),
        "data": data,
        "attach": attach,
        "transfer": transfer,
        "write": lambda: (
            host.write(draw.choice((1, 2, 2, 3, 5, 0x82, 0)), draw.randbytes(draw.choice((0, 1, 64, 65, 130)))),
            bench.go_on(2 * MS),
        ),
        "listen": lambda: host.listen(draw.choice((0x82, 0x81, 0x83, 0x85, 2, 0x80))),
        "read": lambda: host.read(draw.choice((0x82, 0x81, 0x83, 0x85))).hex(),
        "packets": lambda: host.packets(draw.choice((0x82, 0x85))),
        "wait": lambda: host.wait_packet(draw.choice((0x82, 0x85, 0x84))),
        "clear": lambda: host.clear_halt(draw.choice((2, 0x82, 5, 0x85))),
        "halted": lambda: host.halted(draw.choice((2, 0x82, 5, 9))),
        "damage": lambda: host.damage(
            draw.choice(("to device", "to host", "ack", "ack", "none")),
            draw.choice((1, 2, 4)),
            after=draw.choice((0, 1)),
        ),
        "line": lambda: line.receive(draw.randbytes(draw.choice((1, 64, 65)))),
        "set line": lambda: host.set_line(
            draw.choice((None, bytes((0, 194, 1, 0, 0, 0, 8)))), is_open=draw.random() < 0.5
        ),
        "suspend": lambda: (host.suspend(may_wake=draw.random() < 0.5), bench.go_on(4 * MS)),
        "resume": lambda: (host.resume(), bench.go_on(25 * MS)),
        "wake": lambda: (host.wake(device.now_ns), bench.go_on(25 * MS)),
        "reset": lambda: (host.reset(), bench.go_on(draw.choice((10 * MS, 300 * MS)))),
        "plug": host.plug,
        "configured": host.wait_configured,
    }


def descriptors(draw: random.Random) -> Iterator[str]:
    for size in (0, 7, 8, 17, 18, 19):
        yield tried(packet_bytes_of, DEVICE[:size]) + tried(parse_device, (DEVICE + b"x")[:size])
    for data in (DEVICE, CDC, MIXED):
        parse = parse_device if data is DEVICE else parse_configuration
        yield tried(parse, data) + tried(total_bytes_of, data)
        for at in range(len(data)):
            values = (0, 1, 2, 3, 7, 8, 9, 0x10, 0x40, 0x41, 0x64, 0x80, 0xFF)
            yield "\n".join(tried(parse, data[:at] + bytes((value,)) + data[at + 1 :]) for value in values)
        yield "\n".join(tried(parse, data[:at]) for at in range(0, len(data), 3))
    for text_of in (b"", b"\x02", b"\x02\x03", b"\x03\x03a", b"\x04\x03a\0", b"\x06\x03a\0", b"\xff\x03a\0\x00\xd8"):
        yield repr(parse_string(text_of))
    device = parse_device(DEVICE)
    yield said(
        [
            str(device),
            [each.is_in for each in parse_configuration(CDC).endpoints],
            len(parse_configuration(MIXED).endpoints),
        ]
    )
    for kind in (0x80, 0xA1, 0x00, 0x21):
        for request in (
            Request(kind, 6, 0x100, 2, length=18),
            Request(kind, 9, 0x1234, 0xABCD, b"abc"),
            Request(kind, 1),
        ):
            yield f"{request.is_in} {request.to_bytes().hex()}"
    for info in (*parse_configuration(CDC).endpoints, *parse_configuration(MIXED).endpoints):
        pipe = Pipe(info.address, info.kind, info.packet_bytes, info.interval_frames)
        yield said([pipe, pipe.is_in, pipe.is_periodic, pipe.wants])
        pipe.is_listening = True
        pipe.to_send.append(b"")
        yield said([pipe.wants, pipe.halted])
        pipe.halted = "stalled"
        yield said([pipe.wants])
    yield said([span_ns(bits) for bits in (0, 1, 11, 12, 13, 35)])
    yield said(
        [
            transaction_ns(size, has_data=has, is_answered=answered, has_handshake=shakes)
            for size in (0, 1, 64)
            for has in (True, False)
            for answered in (True, False)
            for shakes in (True, False)
        ]
    )


TRACES: dict[str, Trace] = {"enumerations": enumerations, "sessions": sessions, "descriptors": descriptors}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
