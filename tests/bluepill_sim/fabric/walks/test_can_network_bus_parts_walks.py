"""A CAN with nodes of every kind, and frames with every number of bits, as approved."""

import random
from collections.abc import Iterator
from fractions import Fraction

from bluepill_sim.fabric.bus_parts import CanFrame, subscribe_words
from bluepill_sim.fabric.can_network import TOLERANCE, CanEnd, CanNetwork, CanNode, frame_bits, stuffed_bits
from tests.tools.suite.approved import Trace, judge_of, said, tried


class Chip:
    """A member with a clock and a rate of its own."""

    def __init__(self, draw: random.Random, network: CanNetwork, rate: Fraction | None) -> None:
        self.draw, self.network, self.rate = draw, network, rate
        self.now_ns: int | None = 0
        self.acknowledges, self.hears_itself, self.is_passive = True, False, False
        self.coming: list[tuple[int, CanFrame]] = []
        self.lines: list[str] = []
        self.tries_again = True

    @property
    def bit_rate(self) -> Fraction | None:
        return self.rate

    def offer(self, at_ns: int) -> CanFrame | None:
        return self.coming[0][1] if self.coming and self.coming[0][0] <= at_ns else None

    def lose(self, at_ns: int) -> bool:
        self.lines.append(f"lost {at_ns}")
        if not self.tries_again:
            self.coming.pop(0)
        return self.tries_again

    def end(self, end: CanEnd) -> None:
        self.lines.append(said(end))
        if end.is_own:
            self.coming.pop(0)

    def plan(self) -> None:
        self.lines.append(f"plan {self.network.next_ns}")

    def advance_to(self, limit_ns: int) -> None:
        self.now_ns = limit_ns
        self.network.advance_to(limit_ns)


def frame_of(draw: random.Random) -> CanFrame:
    extended = draw.random() < 0.4
    identifier = draw.choice((0, 1, 0x123, 0x124, 0x7FF, 0x400)) | (
        draw.choice((0, 0x1FFF_F800, 0x800)) if extended else 0
    )
    if draw.random() < 0.2:
        return CanFrame(
            identifier=identifier, is_extended=extended, is_remote=True, remote_bytes=draw.choice((0, 1, 8))
        )
    return CanFrame(
        identifier=identifier, is_extended=extended, data=draw.choice((b"", bytes(8), b"\xff" * 3, draw.randbytes(4)))
    )


def networks(draw: random.Random) -> Iterator[str]:
    for _ in range(14):
        network = CanNetwork()
        rates = [
            draw.choice(
                (
                    None,
                    Fraction(500_000),
                    Fraction(250_000),
                    Fraction(507_500),
                    Fraction(507_501),
                    Fraction(1_000_000, 3),
                )
            )
            for _ in range(2)
        ]
        chips = [Chip(draw, network, rate) for rate in rates[: draw.choice((1, 2))]]
        for chip in chips:
            chip.acknowledges, chip.is_passive, chip.hears_itself = (
                draw.random() < 0.8,
                draw.random() < 0.3,
                draw.random() < 0.15,
            )
            chip.tries_again = draw.random() < 0.7
            if draw.random() < 0.3:
                chip.now_ns = None
            network.join(chip)
        nodes = [CanNode(is_silent=draw.random() < 0.3) for _ in range(draw.choice((0, 1, 2)))]
        seen = list[str]()
        for node in nodes:
            _listen(node, seen, hears=draw.random() < 0.5)
            network.join(node)
        yield said([network.next_ns, network.start_ns, network.now_ns, network.coming()])
        yield from _walk(draw, network, chips, nodes, seen)


def _listen(node: CanNode, seen: list[str], *, hears: bool) -> None:
    node.on_sent = lambda frame, at_ns: seen.append(f"sent {at_ns} {said(frame)}")
    node.on_frame = (lambda frame, at_ns: seen.append(f"heard {at_ns} {said(frame)}")) if hears else None


def _walk(
    draw: random.Random, network: CanNetwork, chips: list[Chip], nodes: list[CanNode], seen: list[str]
) -> Iterator[str]:
    now = 0
    for _ in range(22):
        _want(draw, network, chips, nodes, now)
        if draw.random() < 0.2:
            network.damage(draw.choice((1, 2)))
        coming = network.coming()
        ahead = None if coming is None else (type(coming[0]).__name__, coming[1], coming[2])
        line = said([network.next_ns, network.start_ns, network.now_ns, ahead])
        now += draw.choice((1, 20_000, 40_000, 40_001, 300_000))
        if draw.random() < 0.3 and all(chip.now_ns is not None for chip in chips):
            network.run(chips, now)  # type: ignore[arg-type]
        else:
            for chip in chips:
                behind = draw.choice((0, 0, 15_000))
                chip.now_ns = None if chip.now_ns is None else max(chip.now_ns, now - behind)
            network.advance_to(now)
        state = [(node.waiting, node.errors, node.received[-2:], node.snapshot()["_coming"]) for node in nodes]
        kept = {name: value for name, value in network.snapshot().items() if name != "_parts"}
        yield f"{line} {said([[' '.join(chip.lines) for chip in chips], seen, state, kept])}"
        seen.clear()
        for chip in chips:
            chip.lines.clear()
    if chips:
        network.put(chips[0], draw.choice((None, 5)), 9)
        yield said([network.start_ns, network.next_ns])


def frames(draw: random.Random) -> Iterator[str]:
    for _ in range(90):
        frame = frame_of(draw)
        yield f"{said(frame)} {frame.dlc} {stuffed_bits(frame)} {''.join(map(str, frame_bits(frame)))}"
    for given in (
        {"identifier": -1},
        {"identifier": 0x7FF},
        {"identifier": 0x800},
        {"identifier": 0x1FFF_FFFF, "is_extended": True},
        {"identifier": 0x2000_0000, "is_extended": True},
        {"identifier": 1, "data": bytes(8)},
        {"identifier": 1, "data": bytes(9)},
        {"identifier": 1, "is_remote": True, "data": b"x"},
        {"identifier": 1, "is_remote": True, "remote_bytes": 8},
        {"identifier": 1, "remote_bytes": 9},
        {"identifier": 1, "remote_bytes": -1},
    ):
        yield tried(lambda each: said(CanFrame(**each)), given)
    node = CanNode()
    yield tried(node.send, CanFrame(identifier=1)) + said(
        [
            node.offer(0),
            node.lose(0),
            node.now_ns,
            node.bit_rate,
            node.hears_itself,
            node.is_passive,
            node.acknowledges,
            CanNode(is_silent=True).acknowledges,
            TOLERANCE,
        ]
    )


def _want(draw: random.Random, network: CanNetwork, chips: list[Chip], nodes: list[CanNode], now: int) -> None:
    """Have members want to send, or want it no more."""
    for chip in chips:
        if draw.random() < 0.4:
            chip.coming.append((now + draw.choice((0, 7000)), frame_of(draw)))
            network.want(chip, now)
        elif draw.random() < 0.1 and chip.coming:
            chip.coming.clear()
            network.forget(chip)
    for node in nodes:
        if draw.random() < 0.4:
            node.send(frame_of(draw), draw.choice((None, now, now + 90_000)))


class Bus:
    """A bus that keeps words for who wants them."""

    def __init__(self) -> None:
        self.wants_words, self.delivered = 0, 0

    @property
    def native(self) -> "Bus":
        return self

    def deliver(self) -> None:
        self.delivered += 1


def words(draw: random.Random) -> Iterator[str]:
    bus, sinks = Bus(), list[str]()
    ends = [subscribe_words(bus, sinks, name) for name in "ab"]
    yield said([bus.wants_words, bus.delivered, sinks])
    for end in ends:
        end()
        yield said([bus.wants_words, bus.delivered, sinks])


TRACES: dict[str, Trace] = {"networks": networks, "frames": frames, "words": words}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
