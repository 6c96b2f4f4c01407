"""Frames, commands, packets and both ends of a line, each over all that it takes, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import random
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from enum import IntFlag
from typing import get_args

from p2os.protocol import command_table, commands, config_packet, frames, line_time, odometry, sip, times, units
from p2os.protocol.bauds import BAUDS, BAUDS_TEXT, DEFAULT_BAUD
from p2os.protocol.command_table import ALIASES, ROWS, Argument, CommandNumber, command_row
from p2os.protocol.commands import Command, command
from p2os.protocol.config_packet import FIELDS, NUMBERS, ConfigPacket
from p2os.protocol.connection import IDLE, Connection, ConnectionRole, ConnectionSettings
from p2os.protocol.frames import GIVE_UP_NS, Decoder, Frame, checksum, sound_frames
from p2os.protocol.packets import (
    PACKET_KINDS,
    RESET_KINDS,
    BatteryPacket,
    GripperState,
    GyroReading,
    Identity,
    PlainPacket,
    ResetNotice,
    SerauxPacket,
    SimLaserPacket,
    packet_frame,
    packet_name,
    read_packet,
    sensors,
)
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS
from tests.p2os.protocol.drawn_packets import KINDS, Draw, any_packet, any_sip
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

C = CommandNumber
WILMA = Identity("Wilma", "Pioneer", "p2dx")


def rows(draw: random.Random) -> Iterator[str]:
    """Say each row of the table, and what it takes at the ends of its ranges and beyond them."""
    for row in ROWS:
        yield said((int(row.number), row, row.name, row.kind, row.takes, row.is_simulator_only))
        yield said([[row.version(profile), row.is_known_to(profile)] for profile in Profile])
        for kind in [each for each in Argument if each is not Argument.NONE]:
            least, most = row.limits(kind)
            yield said((kind, least, most))
            for size in (least - 1, least, most, most + 1):
                yield tried(command, row.name, size)
                if kind in {Argument.STRING, Argument.DATA} and 0 <= size < 300:
                    yield tried(
                        lambda row=row, size=size: command(row.name.lower(), bytes(size)).to_frame().to_bytes().hex()
                    )
        yield "\n".join(
            [tried(command, int(row.number)), tried(command, row.name, 1, 2), tried(command, row.name, 1, 2, 3)]
        )
        for low, high in (
            (-129, 0),
            (-128, 127),
            (127, -128),
            (128, 0),
            (0, 128),
            (255, 255),
            (256, 0),
            (0, 256),
            (-1, 0),
            (0, -129),
        ):
            yield tried(row.word, low, high)
    yield tried(command, "VEL2", b"a", 1)
    for name in (*ALIASES, "vel-2", "vel2", "VLE", "nothing", 16, 300, -1):
        yield tried(lambda name=name: command_row(name).name)
    yield said(
        [
            command_table.SYNC_NAMES,
            {C.LOADWORLD, C.STEP, C.RESETSIMTOORIGIN} == command_table.OLD_SIMULATORS,
            sorted(command_table.MOTION_COMMANDS),
        ]
    )


def orders(draw: random.Random) -> Iterator[str]:
    """Write commands and read them again, whole, cut and with what no manual names."""
    for number in (-1, 0, 11, 16, 255, 256):
        for argument in (None, 0, 1, -1, 65535, -65535, 65536, -65536, b"", b"ab", bytes(199), bytes(200)):
            yield tried(
                lambda n=number, a=argument: (
                    Command(n, a).name,
                    Command(n, a).integer,
                    Command(n, a).to_frame().to_bytes().hex(),
                )
            )
    for argument in (None, b"x", 0, 1, -1, 0x7F80, 0x80FF, -32768, 65535):
        yield tried(lambda a=argument: (Command(8, a).two_bytes, Command(8, a).signed_bytes))
    for number in (4, 11, *commands.UNCOUNTED):
        for kind in (commands.POSITIVE, commands.NEGATIVE, commands.STRING, 0, 1):
            for size in (0, 1, 2, 3, 4, 5, 198, 199, 200):
                data = bytes([kind, *(draw.choice((0, 1, 2, 199, 200, 255)) for _ in range(size))])
                read = Command.from_frame(Frame(bytes([number]) + data))
                yield said(
                    (
                        number,
                        data[:9].hex(),
                        len(data),
                        read.argument if not isinstance(read.argument, bytes) else read.argument.hex(),
                    )
                )
        yield said(Command.from_frame(Frame(bytes([number]))))
    for left, right in (
        (-129, 0),
        (-128, 0),
        (0, -128),
        (127, -1),
        (128, 0),
        (0, 128),
        (-1, 127),
        (0, -129),
        (1, 0),
        (127, 127),
    ):
        yield tried(commands.vel2, left, right)
    makers = (commands.pulse(), commands.enable(True), commands.enable(False), commands.stop(), commands.vel(-7), commands.rvel(9),
              commands.sonar(True), commands.sonar(False), commands.set_origin())  # fmt: skip
    yield said([(each, each.to_frame().to_bytes().hex()) for each in makers])


def streams(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of acts
    """Let a decoder take frames that are cut, damaged, within each other and late."""
    yield said([checksum(bytes([255] * size)) for size in (0, 1, 2, 3, 64, 255, 256)])
    for size in (0, 1, 202, 203):
        yield tried(lambda size=size: Frame(bytes(size)).to_bytes().hex())
    whole = Frame(b"\x0babc").to_bytes()
    for data in (
        whole,
        whole[:-1],
        whole + b"\0",
        b"\xfb" + whole[1:],
        whole[:2] + b"\7" + whole[3:],
        whole[:-1] + b"\0",
        b"\xfa\xfb\2\0\0",
        b"\xfa\xfb\3\1\0\1",
    ):
        yield tried(Frame.from_bytes, data)
    for number in range(70):
        decoder, now = Decoder(), 0
        for _ in range(draw.randint(2, 8)):
            frame = Frame(draw.randbytes(draw.choice((1, 2, 9, 200, 202)))).to_bytes()
            place = draw.randrange(len(frame))
            data = draw.choice((
                frame, frame, frame[:place], frame[place:], frame[:place] + b"\xfa" + frame[place + 1 :], b"\xfa", b"\xfa\xfb", b"\xfb", b"",
                bytes([0xFA, 0xFB, draw.choice((2, 3, 204, 205))]), b"\xfa\xfb\x20" + frame[:40] + frame, Frame(b"\1" + frame[:190]).to_bytes()[:-1] + b"\1",
            ))  # fmt: skip
            for part in (data[:place], data[place:]) if number % 2 else (data,):
                decoder.receive(part, now)
                now += draw.choice((0, 0, 1, GIVE_UP_NS - 1, GIVE_UP_NS, GIVE_UP_NS + 1))
                if number % 5 == 0:
                    yield said(decoder.take_back() if draw.random() < 0.3 else "")
                if number % 7 == 0:
                    decoder.restore(decoder.snapshot())
            while number % 3 and (item := decoder.next_item()) is not None:
                yield said(item)
            yield said((now, decoder.next_deadline(), decoder.stats))
        decoder.advance_to(now + GIVE_UP_NS)
        while (item := decoder.next_item()) is not None:
            yield said(item)
        yield said((decoder.stats, decoder.next_deadline(), decoder.take_back()))
    stream = whole + Frame(b"\2").to_bytes() + whole
    for place in range(0, len(stream) + 1, 3):
        for limit in (None, len(stream) - 1, len(stream), place + 3, place + 4):
            yield said([payload.hex() for payload in sound_frames(stream, place, limit)])
    for count in (0, 1, 2, 3, 4, 203, 204, 205, 255):
        data = bytes([0xFA, 0xFB, count]) + bytes(300)
        yield said(
            [[len(payload) for payload in sound_frames(data, 0, limit)] for limit in (None, count + 3, count + 2)]
        )
    for size in range(len(stream)):
        yield said([[payload.hex() for payload in sound_frames(stream[:size], place)] for place in (0, size - 2)])
    for hurt in range(len(stream)):
        yield said(
            [payload.hex() for payload in sound_frames(stream[:hurt] + bytes([stream[hurt] ^ 1]) + stream[hurt + 1 :])]
        )


def properties_of(packet: object) -> dict[str, object]:
    """Return what a packet says beside its fields; bits as numbers."""
    found = {name: getattr(packet, name) for name, value in vars(type(packet)).items() if isinstance(value, property)}
    found = {name: int(value) if isinstance(value, IntFlag) else value for name, value in found.items()}
    if isinstance(packet, BatteryPacket):
        found["charges"] = [packet.relative_charge(number) for number in range(len(packet.batteries))]
    if isinstance(packet, GyroReading):
        found["rates"] = [packet.rate_deg_s(), packet.rate_deg_s(500.5, 2.0)]
    if isinstance(packet, StandardSip):
        found["tail"] = [packet.tail_field(name) for name, *_ in sip.TAIL]
    for part in fields(packet) if is_dataclass(packet) else ():
        value = getattr(packet, part.name)
        rows = [properties_of(each) for each in (value if isinstance(value, tuple) else (value,)) if is_dataclass(each)]
        found |= {part.name: rows} if any(rows) else {}
    return found


def packets(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of rows
    """Read a packet of each kind, whole and cut anywhere."""
    for kind in PACKET_KINDS:
        yield said((kind.kind, kind.name, kind.table, packet_name(kind.kind)))
    yield said([packet_name(3), packet_name(255), [(bit.name, bit.value) for bit in GripperState]])
    for plain in get_args(PlainPacket):
        yield tried(lambda plain=plain: (plain.__name__, plain(), plain().to_frame().to_bytes().hex()))
    yield said([sensors.GYRO_CENTRE, sensors.GYRO_DEG_S_PER_COUNT])
    source = Draw(draw.getrandbits(20))
    for name, make in KINDS.items():
        for _ in range(3):
            packet = make(source)
            frame = packet_frame(packet, Profile.P2OS)
            yield said((name, frame.to_bytes().hex(), properties_of(packet)))
            for size in {1, 2, 3, len(frame.payload) // 2, len(frame.payload) - 1, len(frame.payload)}:
                if size:
                    yield said([read_packet(Frame(frame.payload[:size]), profile) for profile in Profile])
    for _ in range(24):
        one = any_sip(source)
        for profile in Profile:
            yield tried(lambda one=one, profile=profile: one.to_frame(profile).to_bytes().hex())
            yield tried(lambda one=one, profile=profile: StandardSip.from_frame(one.to_frame(profile), profile))
        yield said(properties_of(one))
        payload = one.to_frame(Profile.P2OS).payload
        for size in {5, sip.COUNT_AT, sip.COUNT_AT + 1, 24, 25, len(payload) - 1, len(payload)}:
            yield said(
                (
                    sip.is_sip(payload[:size]),
                    sip.unpack_head(payload[:size]),
                    sip.unpack_tail(payload[:size], min(size, 25)),
                )
            )
            yield tried(StandardSip.from_frame, Frame(payload[:size]), Profile.ARCOS)
    several = [any_sip(source).to_frame(Profile.P2OS).payload for _ in range(5)]
    yield said([sip.unpack_heads(several), sip.unpack_heads(several[:1]), sip.unpack_heads([])])
    yield said(
        [
            read_packet(Frame(data), Profile.P2OS)
            for data in (b"\2a\0b\0c\0", b"\2a\0b\0c", b"\2a\0b\0", b"\2\0\0\0", b"\2\0\0\0\0", b"\2")
        ]
    )
    yield said([Identity.from_frame(Frame(b"\2" + data)) for data in (b"", b"a", b"a\0b\0c\0d", b"\0\xe4\0x")])
    yield said([tried(SerauxPacket, port=port) for port in range(5)])
    for change in ({"raw_x": 65536}, {"raw_battery": 256}, {"raw_heading": 32768}, {"rear_bumpers": 128}, {"front_bumpers": 127},
                   {"sonar": (SonarReading(256, 0),)}, {"sonar": tuple(SonarReading(n, n) for n in range(59))},
                   {"sonar": tuple(SonarReading(n, n) for n in range(60))}, {"tail": (65536,)}, {"tail": (1, -129)}, {"tail": (1, -128)},
                   {"tail": (1,) * 9}, {"tail": (1,) * 10}, {"rest": b"ab"}):  # fmt: skip
        yield tried(lambda change=change: replace(StandardSip(), **change).to_frame(Profile.AROS).to_bytes().hex())
    rows = (((1, 2), (3, 4), (5, 6)), ((1,), (3, 4), (5, 6)), ((1, 2), (3,), (5, 6)), ((1, 2), (3, 4), (5,)))
    for ranges, reflectances, flags in rows:
        laser = SimLaserPacket(is_extended=True, ranges_mm=ranges, reflectances=reflectances, flags_of_readings=flags)
        yield tried(lambda laser=laser: laser.to_frame().to_bytes().hex())
    for size in (3, 4, 5):
        yield said(properties_of(BatteryPacket(batteries=(tuple(range(size)),), row_bytes=size)))
    for kind in (0xFD, 0xFE, 0xFF):
        yield said([tried(ResetNotice(kind=kind).to_frame), tried(ResetNotice.from_frame, Frame(bytes((kind, 7))))])
    yield said([StandardSip(), sip.TAIL, sip.TAIL_MEANINGS, sip.SIP_KINDS, sip.BEFORE_SONAR, sip.BEHIND_SONAR])


def settings_of_robots(draw: random.Random) -> Iterator[str]:
    """Write a CONFIGpac with each of its fields at its ends, and read it cut at each byte."""
    yield said([NUMBERS, config_packet.P2OS_FIELDS, config_packet.AROS_1_6_FIELDS, config_packet.AROS_1_7_FIELDS])
    yield said(
        [
            config_packet.AROS_1_8_FIELDS,
            config_packet.AMRISIM_FIELDS,
            config_packet.ARCOS_FIELDS,
            config_packet.MEANINGS,
        ]
    )
    whole = ConfigPacket(fields_sent=len(FIELDS))
    for place, (name, _) in enumerate(FIELDS, 1):
        ends = (*NUMBERS[name], NUMBERS[name][0] - 1, NUMBERS[name][1] + 1) if name in NUMBERS else ("äb", "€", "")
        for value in ends:
            yield tried(
                lambda n=name, v=value, p=place: replace(whole, **{n: v}, fields_sent=p).to_frame().to_bytes().hex()
            )
    data = replace(whole, name="abc", serial="x", watchdog=2000, hightemp=-5).to_frame().payload
    for size in range(1, len(data) + 1):
        read = ConfigPacket.from_frame(Frame(data[:size]))
        yield said((size, read.fields_sent, read.rest, [getattr(read, name) for name, _ in FIELDS][-6:], read.name))
    yield said((ConfigPacket(), ConfigPacket.from_frame(Frame(data + b"more"))))


def counters(draw: random.Random) -> Iterator[str]:
    """Follow counters over their wraps, and characters over a line."""
    for modulus in (4, 5, 32768):
        for last in (None, 0, modulus - 1):
            one = odometry.Unwrapper(modulus, last)
            for _ in range(12):
                raw = draw.choice((0, 1, modulus // 2 - 1, modulus // 2, modulus // 2 + 1, modulus - 1))
                if draw.random() < 0.1:
                    one.forget()
                yield said((raw, one.update(raw), one.total, one.snapshot()))
    robots = [load_parameters(name) for name in ("p2dx", "p3at-sh", "amigo", "seekur")]
    for robot in robots:
        one = odometry.Odometry(robot)
        for _ in range(12):
            packet = StandardSip(
                raw_x=draw.randrange(65536),
                raw_y=draw.choice((0, 16383, 16384, 32767)),
                raw_heading=draw.choice((-2049, -2048, 0, 2047, 2048, 4095, 4096, 9000)),
            )
            one.update(packet)
            yield said((one.x_m, one.y_m, one.heading_rad, one.snapshot()))
        yield said(
            [
                [
                    units.heading_rad(raw, robot),
                    units.rim_mps(raw, robot),
                    units.range_m(raw, robot),
                    units.battery_v(raw),
                ]
                for raw in (-2049, -1, 0, 1, 1024, 2048, 4096)
            ]
        )
    for baud in (None, *BAUDS):
        line, now = line_time.LineTime(baud), 0
        for _ in range(12):
            line = line.sent(draw.choice((0, 1, 7, 200)), now)
            if draw.random() < 0.2:
                line = line.at_baud(draw.choice(BAUDS))
            yield said((line, line.free_at, [line.time_of(count) for count in (0, 1, 3)]))
            now = draw.choice((line.free_at - 1, line.free_at, line.free_at + 1, now + 5))
    yield said(
        [
            BAUDS,
            BAUDS_TEXT,
            DEFAULT_BAUD,
            times.CYCLE_NS,
            times.WATCHDOG_NS,
            times.PULSE_NS,
            times.LIVENESS_NS,
            frames.GIVE_UP_NS,
        ]
    )


def happened(end: Connection) -> Iterator[str]:
    while (event := end.next_event()) is not None:
        yield said((type(event).__name__, event))
    sent = [data.hex() for data in end.take_output()]
    yield said((end.state, end.is_open, end.next_deadline(), sent, end.stats, [*end._side.snapshot().values()]))


def answers(draw: random.Random) -> Frame:
    """Return what a robot may say, the answer that is waited for more often than the rest."""
    empty = draw.choice(
        (
            [0],
            [1],
            [2, 65, 0, 66, 0, 67, 0],
            [0, 1],
            [1, 1],
            [2],
            [3],
            [0x20, 1, 0],
            [0x33],
            [0x90, 1, 2, 3, 4, 5, 6, 7, 8],
        )
    )
    kinds = (Frame(bytes(empty)), Frame(bytes(empty)), any_sip(Draw(7)).to_frame(Profile.P2OS), Frame(bytes([draw.choice([*RESET_KINDS])])),
             packet_frame(any_packet(Draw(draw.randrange(99))), Profile.P2OS), Frame(bytes([0xF0])))  # fmt: skip
    return draw.choice(kinds)


def clients(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of acts
    """Let a client meet robots that answer, do not, are open, restart, are reset and fall silent."""
    for name in [part.name for part in fields(ConnectionSettings)][:9]:
        for value in (-1, 0, 1):
            yield tried(ConnectionSettings, **{name: value})
    yield said([ConnectionSettings(), IDLE])
    for number in range(60):
        chosen = ConnectionSettings(
            sync_attempts=draw.choice((1, 2, 3)), open_attempts=draw.choice((1, 2, 3)), stop_first=draw.random() < 0.3,
            profile=draw.choice([*Profile]), open_retry_ns=draw.choice((40, 300)) * NS_PER_MS,
        )  # fmt: skip
        end, now = Connection(ConnectionRole.CLIENT, settings=chosen), 1000
        yield said(end.snapshot())
        yield tried(end.connect, now)
        for _ in range(draw.choice((9, 24))):
            wanted = {"SYNC0": Frame(b"\0"), "SYNC1": Frame(b"\1"), "SYNC2": Frame(b"\2A\0Pioneer\0p2dx\0")}.get(
                end.state.name
            )
            match draw.randrange(12):
                case 0 | 1 | 2 | 3 if wanted is not None:
                    end.receive(wanted.to_bytes(), now)
                case 0 | 1 | 2:
                    end.receive(answers(draw).to_bytes(), now)
                case 4:
                    end.receive(
                        draw.choice((b"\xfa\xfb\2", b"xyz", b"\xfa", Frame(b"\0").to_bytes()[:-1] + b"\7")), now
                    )
                case 5 if number % 4 == 0:
                    end.disconnect(now)
                case 6:
                    yield tried(end.connect, now)
                case 7:
                    yield tried(end.send, draw.choice((commands.vel(100), Frame(b"\x0b"), StandardSip())), now)
                case 8 if number % 4 == 1:
                    end.set_profile(draw.choice([*Profile]))
                case 9 if number % 4 == 2:
                    end.restore(end.snapshot())
                case 10 if number % 9 == 0:
                    yield tried(end.count_silence, 5, now)
                case _:
                    due = end.next_deadline()
                    now = now + NS_PER_MS if due is None else max(now, due + draw.choice((-1, 0, 1)))
                    end.advance_to(now)
            yield from happened(end)


def opened(draw: random.Random) -> Iterator[str]:
    """Let an open session take each packet, before the first and behind it, and a handshake take a reset and a SIP."""
    source = Draw(99)
    every = [packet_frame(make(source), Profile.P2OS) for make in KINDS.values()]
    every += [
        Frame(bytes(each)) for each in ([0], [1], [0, 1], [2], [0x20, 65, 0, 66, 0], [0x33], [0xFF], [0xFE], [0x77, 1])
    ]
    handshake = (b"\0", b"\1", b"\2A\0Pioneer\0p2dx\0")
    for frame in every:
        for step in range(4):
            end = Connection(ConnectionRole.CLIENT, settings=ConnectionSettings(sync_attempts=2, open_attempts=2))
            end.connect(0)
            for payload in handshake[:step]:
                end.receive(Frame(payload).to_bytes(), 0)
            if step == 3:
                end.advance_to(100 * NS_PER_MS)
            for repeat in range(2):
                end.receive(frame.to_bytes(), 200 * NS_PER_MS)
                yield from happened(end) if repeat or step == 3 else ()
            for wait in (549, 550, 1200, 2600):
                end.advance_to(wait * NS_PER_MS)
            yield from happened(end)


def layouts(draw: random.Random) -> Iterator[str]:
    """Let both ends send and take a SIP by each family's layout, changed before and in a session."""
    packet = StandardSip(
        analog_port=3, gripper_state=6, raw_analog=7, tail=(900, 5), sonar=(SonarReading(2, 40), SonarReading(5, 60))
    )
    for before in Profile:
        for inside in Profile:
            client = Connection(ConnectionRole.CLIENT, settings=ConnectionSettings(open_delay_ns=NS_PER_MS))
            server, now = Connection(ConnectionRole.SERVER, identity=WILMA), draw.choice((0, 5, NS_PER_MS))
            for end in (client, server):
                end.set_profile(before)
            client.connect(now)
            for _ in range(5):
                for one, other in ((client, server), (server, client)):
                    one.advance_to(now)
                    for data in one.take_output():
                        other.receive(data, now)
                now += NS_PER_MS
            for profile in (before, inside):
                client.set_profile(profile)
                server.set_profile(profile)
                server.send(packet, now)
                client.receive(b"".join(server.take_output()), now)
                yield from (line for end in (client, server) for line in happened(end))


def again(draw: random.Random) -> Iterator[str]:
    """Let a client give up, lose its robot, and begin again; by each number of attempts."""
    open_robot, name = StandardSip().to_frame(Profile.P2OS).to_bytes(), WILMA.to_frame().to_bytes()
    answered = (Frame(b"\0").to_bytes(), Frame(b"\1").to_bytes(), name)
    for attempts in (1, 2, 3):
        for kind in ("silent", "open", "reset", "lost"):
            end, now = Connection(ConnectionRole.CLIENT, settings=ConnectionSettings(sync_attempts=attempts)), 0
            for _ in range(3):
                yield tried(end.connect, now)
                for step in range(12):
                    if kind == "open" and step % 2 == 0:
                        end.receive(open_robot, now)
                    elif kind == "reset" and step < 9:
                        end.receive(Frame(bytes([draw.choice([*RESET_KINDS])])).to_bytes(), now)
                    elif kind == "lost" and step < 3 and end.state.name in {"SYNC0", "SYNC1", "SYNC2"}:
                        end.receive(answered[step], now)
                    due = end.next_deadline()
                    now = now + NS_PER_MS if due is None else max(now, due)
                    end.advance_to(now)
                    yield from happened(end)
                    if end.state in IDLE:
                        break


def servers(draw: random.Random) -> Iterator[str]:
    """Let a server meet clients that say its numbers in each order, with and without arguments, and fall silent."""
    for number in range(48):
        end = Connection(
            ConnectionRole.SERVER,
            identity=draw.choice((None, WILMA)),
            watchdog_ns=draw.choice((10, 2000)) * NS_PER_MS,
            lenient=number % 3 == 0,
        )
        now = 7
        for _ in range(24):
            match draw.randrange(10):
                case 0 if end.is_open:
                    yield tried(
                        end.send, draw.choice((StandardSip(raw_x=9), Frame(b"\x33"), commands.pulse(), WILMA)), now
                    )
                case 1:
                    due = end.next_deadline()
                    now = now + NS_PER_MS if due is None else max(now, due + draw.choice((-1, 0, 1)))
                    end.advance_to(now)
                case 2 if number % 4 == 1:
                    end.count_silence(draw.choice((0, NS_PER_MS, 9 * NS_PER_MS, 3000 * NS_PER_MS)), now)
                case 3 if number % 4 == 2:
                    end.restore(end.snapshot())
                case 4 if number % 9 == 0:
                    yield "\n".join(
                        [tried(end.connect, now), tried(end.disconnect, now), tried(end.send, commands.pulse(), now)]
                    )
                case 5:
                    end.receive(Frame(bytes([draw.choice((3, 4, 11, 29, 255))])).to_bytes(), now)
                case _:
                    which = draw.choice((0, 1, 2))
                    order = {"CLOSED": 0, "SYNC0": 1, "SYNC1": 2, "SYNCED": 1}.get(end.state.name, which)
                    bare = Command(draw.choice((order, order, which)), draw.choice((None, None, 1)))
                    end.receive(bare.to_frame().to_bytes(), now)
            now += draw.choice((0, 1, NS_PER_MS))
            yield from happened(end)


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (rows, orders, streams, packets, settings_of_robots, counters, clients, opened, layouts, again, servers)
}
TRACES["declared"] = declared_of("p2os.protocol", "p2os.protocol.packets")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
