"""Wires driven at random: nets and their waves, edges in bulk, the chip's pins, serial lines, and their ends."""

import zlib
from array import array
from collections.abc import Iterator
from dataclasses import replace
from importlib import resources
from itertools import product
from pathlib import Path
from random import Random

from adapter_sim.pinout import load_pinout
from bluepill_sim.fabric.pins import PinMode
from bluepill_sim.fabric.subscriptions import EDGE, Wave
from robot_bench.wires.board_test.circuit import BoardFault, Circuit, Side, VoltageSource, WireFault
from robot_bench.wires.board_test.ends import AdapterEnd, BluePillEnd
from robot_bench.wires.chip_pins import ChipPins, number_of
from robot_bench.wires.edges import Edges, changes, codes, dumped, pack, sampled, split, unpack
from robot_bench.wires.endpoints import Endpoint
from robot_bench.wires.line_ends import ENDS
from robot_bench.wires.nets import Harness, Net, OwnedPins, Strength, WaveDrive
from robot_bench.wires.port_endpoint import PortEndpoint, stop_robot
from robot_bench.wires.power_up import power_up
from robot_bench.wires.serial_line import SerialLine
from robot_bench.wires.waves import edge_times
from simbase.timing import NS_PER_S, Reached
from tests.robot_bench.wires.fake_chip import PortsChip
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

OWNERS = ("chip", "adapter", "board")


def wave_drive(draw: Random, at: int) -> WaveDrive:
    period = draw.choice((2, 10, 36))
    wave = Wave(at, draw.randrange(period), period, draw.choice((1, period // 2, period - 1)), NS_PER_S // 10)
    return WaveDrive(wave, draw.choice((Strength.PUSH_PULL.codes, Strength.OPEN_DRAIN.codes, Strength.PULL.codes)))


def shown(net: Net, at: int) -> str:
    """Return all that a net shows at a time and about it."""
    held = [net.level_without(owner, at) for owner in OWNERS]
    times = range(max(0, at - 60), at + 1, 20)
    return said([
        net.level(at), [int(net.level(one)) for one in times], net.wave(at), held, net.course(max(0, at - 30), at + 5),
        [list(net.times_after(owner, at - 40)) for owner in OWNERS], [net.drive_at(owner, at) for owner in OWNERS],
        net.levels_without("chip", times), [net.is_alone(*pair) for pair in (("chip", "adapter"), ("board", "chip"))],
        net.last_edge,
    ])  # fmt: skip


def nets(draw: Random) -> Iterator[str]:
    """Drive nets by several owners, by levels, in turn and by waves, and read, report and forget them meanwhile."""
    for round_ in range(16):
        net, now, reached, reported = Net("DD1", idle=round_ % 2 == 1), 0, -1, list[str]()
        net.watch(lambda one, owner, at, reported=reported: reported.append(f"{one.name} {owner} {at}"))
        may_wave = round_ % 3 != 0
        owners = OWNERS[: draw.choice((1, 2, 3, 3))]
        for _ in range(26):
            now += draw.choice((0, 1, 5, 17))
            owner, chance = draw.choice(owners), draw.random()
            if chance < 0.4:
                done = tried(
                    net.drive, owner, draw.random() < 0.5, draw.choice([*Strength]), now - (draw.random() < 0.1)
                )
            elif chance < 0.5:
                times = array("q", sorted({now + draw.randrange(30) for _ in range(3)}))
                done = tried(net.drive_in_turn, owner, times, bytes(draw.randrange(7) for _ in times))
            elif chance < 0.65 and may_wave:
                again = net.drive_at(owner, now)
                shape = again if again is not None and draw.random() < 0.4 else wave_drive(draw, now)
                done = tried(net.wave_from, owner, shape, now)
            elif chance < 0.72:
                done = tried(net.release, owner, now)
            elif chance < 0.9:
                reached = max(reached, now - draw.choice((0, 3)))
                edges = net.edges_until(reached)
                done = f"{reached} {edges} {said(net.take_contentions())} {said(net.take_waves())}"
            elif chance < 0.95:
                done = f"forgotten {net.forget_before(min(now, reached))}"
            else:
                other = Net("DD1", idle=net.idle)
                other.restore(net.snapshot())
                done = f"restored {shown(other, now) == shown(net, now)}"
            yield f"{now} {owner} {done} {taken(reported)} {shown(net, now)}"


def bulk(draw: Random) -> Iterator[str]:
    """Sort, pack, merge, dump and sample edges of several wires, at equal times and far apart."""
    for _ in range(40):
        wires = draw.choice((1, 2, 3, 8, 9, 20))
        tracks, steps = list[Edges](), (0, 1, 100, 999, 1000, 1001, 130_000, 10**10)
        for _ in range(wires):
            at, level, rows = draw.choice((0, 0, 1000)), draw.randrange(2), list[tuple[int, int]]()
            for _ in range(draw.choice((0, 1, 5, 12))):
                rows.append((at, level))
                at, level = at + draw.choice(steps[1:-1]), 1 - level
            tracks.append(Edges(rows))
        blocks = [*pack(tracks, draw.choice((1, 3, 1000)))]
        yield said([(first, count, data.hex()) for first, count, data in blocks])
        yield said([[(wire, list(times)) for wire, times in unpack(data, wires, first)] for first, _, data in blocks])
        damaged = [data[:-1] + draw.choice((b"", b"\xff", b"\x80")) for _, _, data in blocks[:2]]
        yield said([tried(lambda d=one, w=wires: [(w, list(t)) for w, t in unpack(d, w, 3)]) for one in damaged])
        yield said([*codes(tracks[:8])])
        yield said([*dumped(tracks, [chr(33 + n) * (1 + n % 2) for n in range(wires)])])
        rate = draw.choice((10**9, 10**6, 500_000))
        yield said([piece.hex() for piece in sampled(tracks, rate, draw.choice((0, 1, 60)))])
        noisy = Edges([(draw.choice((1, 1, 2, 5)) + 3 * n, draw.randrange(2)) for n in range(9)])
        noisy = Edges(sorted(noisy))
        yield f"{noisy} {changes(noisy, draw.randrange(2))} {noisy[1:3]} {noisy == list(noisy)} {noisy == 3}"
        places = bytes([draw.choice((0, 1, 2, 255)) for _ in range(256)])
        rows_ = b"".join(
            EDGE.pack(n, draw.randrange(9), draw.randrange(5), 0, 0, 0) for n in range(draw.choice((0, 9)))
        )
        found = split(rows_, places, bytes(range(7, 256)) + bytes(7), 3)
        yield said([(wire, list(times), drives.hex()) for wire, times, drives in found])
    longest = b"\xff" * 8
    for block, wires, first in (
        (b"", 1, 0), (b"", 0, 0), (b"", 255, 0), (b"", 254, 0), (b"\x01", 1, -1), (longest + b"\xff\x01", 1, 0),
        (longest + b"\x7f", 1, 0), (longest + b"\x7f", 1, 1), (b"\x01", 1, 2**63 - 2), (b"\x01", 1, 2**63 - 1),
    ):  # fmt: skip
        yield f"{block.hex()} {wires} {first} {tried(lambda b=block, w=wires, f=first: str(unpack(b, w, f)))}"
    for at, level in ((0, 256), (2**63, 1), (-(2**63), 0), (5, -1)):
        kept = Edges([(1, 0)])
        yield f"{tried(kept.append, at, level)[:60]} {len(kept)} {len(kept.times)}"
    long = Edges([(1000 * n, n % 2) for n in range(60_000)])
    pieces = [*dumped([long, long], ["a", "bc"])]
    yield said([[len(piece) for piece in pieces], pieces[0][-20:], pieces[-1][-20:]])
    samples = [*sampled([long] * 9, 10**9, (1 << 19) + 3)]
    yield said([[len(piece) for piece in samples], samples[0][-4:].hex(), samples[1].hex()])


def waves(draw: Random) -> Iterator[str]:
    """Say when waves change in spans that begin and end at their edges and beside them."""
    for _ in range(60):
        period = draw.choice((2, 7, 900, 3600))
        hz = draw.choice((72_000_000, 8_000_000, NS_PER_S))
        wave = Wave(draw.choice((0, 13)), draw.randrange(period), period, draw.randrange(1, period), hz)
        begin = draw.choice((13, 20, 1000))
        found = [*edge_times(wave, begin, begin + draw.choice((0, 1, 40, 4 * period * NS_PER_S // hz)))]
        yield f"{wave} {begin} {found[:40]}"
        if found:
            yield said([[*edge_times(wave, found[0] + by, found[-1] + to)][:9] for by, to in product((0, 1), (0, 1))])


def pins(draw: Random) -> Iterator[str]:
    """Drive a chip's pins from both sides, at their time and ahead of it, with some of them watched."""
    modes = (PinMode.PUSH_PULL, PinMode.FLOATING, PinMode.OPEN_DRAIN, PinMode.PULLED, PinMode.ALTERNATE_PUSH_PULL)
    for _ in range(10):
        chip, edges = PortsChip("PA0", "PA1", "PB2"), list[int]()
        harness = Harness([Net("a"), Net("b", idle=True), Net("c")])
        for net in harness:
            if draw.random() < 0.4:
                net.drive("board", draw.random() < 0.5, Strength.PULL, 0)
        names = {"a": "PA0", "b": "PA1", "c": "PB2"}
        joined = ChipPins(chip, harness, names, on_watched=edges.append)  # type: ignore[arg-type]
        for _ in range(22):
            chip.run(chip.now_ns + draw.choice((0, 1, 40)))
            net, chance = draw.choice([*harness]), draw.random()
            pin, done = chip.pin(names[net.name]), ""
            if chance < 0.4:
                pin.configure(draw.choice(modes), output_bit=draw.random() < 0.5)
            elif chance < 0.5 and pin is chip.pin("PA0"):
                pin.offer_wave("TIM2_CH1", NS_PER_S, draw.choice((30, 90)), 20)
            elif chance < 0.6:
                at = chip.now_ns + draw.choice((0, 0, 30))
                done = tried(net.drive, "adapter", draw.random() < 0.5, draw.choice([*Strength]), at)
            elif chance < 0.75:
                times = array("q", [chip.now_ns + 10, chip.now_ns + 25])
                done = tried(net.drive_in_turn, "other", times, bytes(draw.choice((1, 2, 5, 6)) for _ in times))
            elif chance < 0.9:
                joined.watch(frozenset(draw.sample(("a", "b", "c"), draw.randrange(3))), chip.now_ns - 5)
            else:
                joined.chip_restored()
            chip.run(chip.now_ns + 1)
            levels = "".join(str(int(one.level(chip.now_ns))) for one in harness)
            ends = [chip.pin(name) for name in names.values()]
            inside = [(end.level, end.input, end.output, end.is_contended, end.is_floating) for end in ends]
            yield f"{chip.now_ns} {net.name} {done} {levels} {said(inside)} {edges} {harness['a'].wave(chip.now_ns)}"
            edges.clear()


def ends_of_wires(_draw: Random) -> Iterator[str]:
    """Write to wires as the adapter does, one of which is cut."""
    yield said([number_of(name) for name in ("PA0", "PB2", "PC13", "PE15")])
    harness = Harness([Net("a"), Net("b", idle=True)])
    owned = OwnedPins(harness, "me", cut=["b"])
    for at, (name, high) in enumerate(product("ab", (True, None, False)), 1):
        owned.write(name, high, at)
        yield said([owned.read(name, at), owned.course(name, at - 1, at + 1), harness[name].last_edge])


class Part:
    """A part at a line: what it is given is noted, and it answers some of it."""

    def __init__(self, draw: Random, heard: list[str]) -> None:
        self._draw, self._heard, self.due = draw, heard, None

    def receive(self, data: bytes, now: int) -> None:
        self._heard.append(f"gets {data.hex()} {now}")
        self.due: int | None = now + self._draw.choice((0, 5000, 900_000))

    def next_deadline(self) -> int | None:
        return self.due

    def advance_to(self, limit: int) -> Reached:
        self._heard.append(f"to {limit}")
        return Reached(limit)

    def take_output(self) -> list[bytes]:
        return [bytes(self._draw.randrange(256) for _ in range(n)) for n in range(self._draw.randrange(3))]


def lines(draw: Random) -> Iterator[str]:
    """Send along lines that are busy, idle and cut, to ends that see bytes at once, or later."""
    yield said([tried(lambda b=baud: SerialLine(b).baud) for baud in (-1, 0, 1, 9600)])
    for _ in range(12):
        heard: list[str] = []
        one, other = SerialLine(), SerialLine(draw.choice((1, 9600, 115_200)))
        sight = draw.choice((None, lambda at: at + 500))
        end = Endpoint(Part(draw, heard), incoming=one, outgoing=other, first_sight=sight,  # type: ignore[arg-type]
                       on_arrival=lambda data, at, heard=heard: heard.append(f"on {data.hex()} {at}"))  # fmt: skip
        now = 0
        for _ in range(20):
            now += draw.choice((0, 1_000_000, 1_041_667, 30_000_000))
            chance = draw.random()
            if chance < 0.5:
                one.send(bytes(draw.randrange(256) for _ in range(draw.choice((0, 1, 1, 9)))), now)
            elif chance < 0.6:
                one.is_cut = not one.is_cut
            elif chance < 0.7:
                kept = SerialLine(one.baud)
                kept.restore(one.snapshot())
                heard.append(f"{kept.free_at == one.free_at} {kept.next_deadline() == one.next_deadline()}")
            due = end.next_deadline()
            if due is not None and draw.random() < 0.7:
                now = max(now, due)
            end.advance_to(now)
            other.advance_to(now)
            yield said([now, due, end.next_deadline(), one.free_at, one.next_deadline(), other.free_at, taken(heard),
                        [(each.at, each.data.hex()) for each in other.take_arrived()]])  # fmt: skip
    calls: list[str] = []
    at_port = PortEndpoint(
        Part(draw, calls), Acted(calls, "port", read=[b"", b"abc", b"", b"d"] * 9),  # type: ignore[arg-type]
        on_sent=lambda data, at: calls.append(f"sent {data.hex()} {at}"),
        on_received=lambda data, at: calls.append(f"received {data.hex()} {at}"),
    )  # fmt: skip
    now = 0
    for _ in range(14):
        now += draw.choice((0, 1, 1_999_999, 2_000_000, 2_000_001))
        yield said([now, at_port.next_deadline(), at_port.advance_to(now), at_port.next_deadline(), taken(calls)])
    written: list[bytes] = []
    stop_robot(type("Port", (), {"write": staticmethod(written.append)}))  # type: ignore[arg-type]  # all that is asked
    yield said([one.hex() for one in written])
    for name, end_ in ENDS.items():
        yield said([name, end_.what, end_.group, end_.ships, tried(end_.check, "none"), tried(end_.make, "none")])


def boards(draw: Random) -> Iterator[str]:
    """Measure boards with several faults, and speak with their two modules."""
    pinout = load_pinout()
    names = [wire.name for wire in pinout.wires]
    for _ in range(12):
        faults = tuple(
            BoardFault(draw.choice([*WireFault]), *draw.sample(names, 2), draw.choice([*Side])) for _ in range(2)
        )
        if faults[0].kind is WireFault.SHORT:
            faults = (replace(faults[0], other="EN"), faults[1])
        board = Circuit(pinout, faults)
        for _ in range(2):
            ends = [(faults[draw.randrange(2)].wire, draw.choice([*Side])), (draw.choice(names), draw.choice([*Side]))]
            drives = {end: VoltageSource(draw.choice((0.0, 3.3)), draw.choice((50.0, 40_000.0))) for end in ends}
            found = board.volts(drives)
            yield f"{said(faults)} {said(drives)} {said([round(volts, 4) for volts in found.values()])}"
    calls: list[str] = []
    answers = [None, "board_test 1 csr 1c000000", "crystal 1", "crystal 0", None, "r 00a5 3", None, "r ffffff 1"]
    line = Acted(calls, "chip", ask=answers)
    chip = BluePillEnd(line)
    yield said([chip.greet(), chip.greet(), chip.has_crystal(), chip.has_crystal(), chip.has_crystal(),
                chip.hold(driven=5, levels=4, pulled=2), chip.hold(), chip.pulse(3, 1)])  # fmt: skip
    yield taken(calls)
    answers = ["test on, started by power-on", None, "test off", "wires 1 2", None, "wires in a5 out 5a", None, "link",
               "link 55aa", None, "link", "pad none", None, "pad 12 buttons 3"]  # fmt: skip
    adapter = AdapterEnd(Acted(calls, "esp", ask=answers), pinout)
    yield said([adapter.begin(), adapter.begin(), adapter.end(), adapter.hold(0x15, 0xFFFF), adapter.hold(0, 0),
                adapter.read(), adapter.read(), adapter.send(b"U"), adapter.received(), adapter.received(),
                adapter.received(), adapter.pad(), adapter.pad(), adapter.pad()])  # fmt: skip
    yield taken(calls)


def power(_draw: Random) -> Iterator[str]:
    """Power boards up with memory of both kinds, and crystals that are fast and slow."""
    program = Path(str(resources.files("robot_bench.firmware").joinpath("motors.elf")))
    for sram, ppm, seed in (("zeros", 0, 1), ("random", 50, 2), ("random", -50, 2), ("random", 0, 3)):
        board = power_up(program, sram=sram, crystal_ppm=ppm, seed=seed)
        memory = bytes(board.chip.memory.sram)
        yield said([sram, ppm, seed, board.chip.parts.rcc.hse_hz, memory[:20].hex(), zlib.crc32(memory)])


TRACES: dict[str, Trace] = {
    "nets": nets, "bulk": bulk, "waves": waves, "pins": pins, "ends": ends_of_wires, "lines": lines, "boards": boards,
    "power": power,
}  # fmt: skip
for _package in ("wires", "wires.board_test"):
    TRACES[f"declared in {_package}"] = declared_of(f"robot_bench.{_package}")
test_what_wires_carry_is_what_was_approved = judge_of(__file__, TRACES)
