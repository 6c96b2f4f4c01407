"""Captures beside runs, with every kind of skew, and files of waveforms with every kind of fault, as approved."""

import random
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from bluepill_sim.analysis.edge_log import EdgeLog
from bluepill_sim.analysis.waveforms import sigrok_reader
from bluepill_sim.analysis.waveforms.alignment import ChannelPair, Clock, Tolerance, align, meet
from bluepill_sim.analysis.waveforms.comparison import PinComparison, compare_pins, wires_of
from bluepill_sim.analysis.waveforms.levels import LevelEdge, Waveforms, signal_of
from bluepill_sim.analysis.waveforms.reading import read_waveforms
from bluepill_sim.analysis.waveforms.sample_rate import RATES_HZ, rate_in_words, rate_of, rate_of_times
from bluepill_sim.analysis.waveforms.sigrok_writer import RATE_NAMES, runs, sample_at, write_session, write_sigrok
from bluepill_sim.analysis.waveforms.vcd_writer import identifier, write_vcd
from tests.bluepill_sim.analysis.waveforms.captures import SAMPLE_NS, Analyser, random_run, seen, with_edges
from tests.tools.suite.approved import Trace, judge_of, said, tried


def found_in(found: PinComparison) -> str:
    """Return a comparison as a line; of what met, how many and the ends."""
    met = [
        (
            one.track.channel,
            one.track.pin,
            len(one.pairs),
            [*one.pairs[:2], *one.pairs[-2:]],
            one.added,
            one.missing,
            one.gain,
        )
        for one in found.met
    ]
    return said(
        [
            found.alignment,
            found.miswired,
            found.unexplained,
            found.unjudged,
            found.first,
            found.explained,
            met,
            late_of(found),
        ]
    )


def late_of(found: PinComparison) -> list[float | None]:
    return [found.late_ns(one) for one in found.met]


def with_pulses(draw: random.Random, run: Waveforms, sample_ns: float) -> Waveforms:
    """Return a run with pulses of about a sample, which an analyser may not have seen."""
    pin = draw.choice([*run.signals])
    edges = list(run.signals[pin].edges)
    for _ in range(draw.choice((1, 2))):
        at = draw.randrange(len(edges) - 1)
        when, level = edges[at][0] + 20.0, edges[at][1]
        pulse = draw.choice((sample_ns, sample_ns - 1.0, sample_ns + 1.0))
        edges[at + 1 : at + 1] = [(when, level ^ 1), (when + pulse, level)]
    return with_edges(run, {pin: sorted(edges)})


def skewed(draw: random.Random, capture: Waveforms) -> Waveforms:
    """Return a capture with something wrong in it."""
    pin, other = draw.sample([*capture.signals], 2)
    edges: list[LevelEdge] = list(capture.signals[pin].edges)
    others = list(capture.signals[other].edges)
    at = draw.randrange(2, max(3, len(edges) - 3))
    kind = draw.choice(("late", "lost", "pulse", "glitch", "swapped", "inverted", "jump", "none", "slow", "silent"))
    if not edges or kind == "none":
        return capture
    if kind == "late":
        edges[at] = (edges[at][0] + draw.choice((15.0, -20.0, 90.0, 400.0)), edges[at][1])
    elif kind == "lost":
        del edges[at]
    elif kind == "pulse":
        del edges[at : at + 2]
    elif kind == "glitch":
        when, level = edges[at][0] + 37.0, edges[at][1]
        edges[at + 1 : at + 1] = [(when, level ^ 1), (when + 50.0, level)]
    elif kind == "inverted":
        edges = [(when, level ^ 1) for when, level in edges]
    elif kind == "slow":
        edges = [(when + 120.0 * n, level) for n, (when, level) in enumerate(edges)]
    elif kind == "silent":
        edges = []
    elif kind == "swapped":
        return with_edges(capture, {pin: others, other: edges})
    else:
        from_ns = edges[at][0]
        return with_edges(
            capture,
            {
                name: [(when + 5e5 * (when >= from_ns), level) for when, level in signal.edges]
                for name, signal in capture.signals.items()
            },
        )
    return with_edges(capture, {pin: edges})


def comparisons(draw: random.Random) -> Iterator[str]:
    for number in range(56):
        run = random_run(number, edges=draw.choice((5, 12, 24, 40)), pins=draw.choice((2, 3)))
        how = Analyser(
            offset_ns=draw.choice((0.0, 1e6, -3e5)),
            ppm=draw.choice((0.0, 40.0, -90.0)),
            jitter=draw.choice((0, 0, 1)),
            seed=number,
            sample_ns=draw.choice((1.0, SAMPLE_NS, 100.0)),
            between=draw.choice(((0.0, 1.0), (0.0, 1.0), (0.2, 0.8))),
        )
        capture = skewed(draw, seen(run, how))
        if draw.random() < 0.3:
            run = with_pulses(draw, run, how.sample_ns)
        if draw.random() < 0.2:
            pin = next(iter(run.signals))
            run = replace(run, signals={**run.signals, pin: replace(run.signals[pin], unknown=[(0.0, run.end_ns / 3)])})
        options = draw.choice(({}, {}, {"jitter_samples": 0.0}, {"most_error": 1e-4}))
        yield tried(
            lambda *each: found_in(compare_pins(*each[:3], **each[3])),
            run,
            capture,
            {pin: pin for pin in capture.signals},
            options,
        )
    for pins in ({}, {"pa0": "Pa1"}, {"x": "PA0"}, {"PA0": "x"}):
        run = random_run(1, edges=2, pins=8)
        wide = replace(run, signals={**run.signals, **{f"D{n}": run.signals["PA0"] for n in range(9)}})
        yield tried(wires_of, run, wide, pins) + tried(wires_of, replace(wide, name="wide"), run, pins)
        yield tried(wires_of, replace(run, signals={"Q": run.signals["PA0"]}), wide, pins)


def meetings(draw: random.Random) -> Iterator[str]:
    for _ in range(60):
        at, edges = 0.0, list[LevelEdge]()
        for n in range(draw.choice((0, 1, 6, 12))):
            at += draw.choice((1.0, 2.0, 10.0, 10.0))
            edges.append((at, n & 1))
        moved = [
            (when + draw.choice((0.0, 1.0, -1.0, 2.0, 2.001)), level) for when, level in edges if draw.random() < 0.85
        ]
        track = ChannelPair("c", "p", sorted(moved), edges, draw.random() < 0.15)
        limits = Tolerance(
            2.0,
            draw.choice((1e-6, 1e-3)),
            (draw.choice((0.0, 5.0)), draw.choice((30.0, 200.0))),
            (0.0, draw.choice((50.0, 200.0))),
        )
        clock = Clock(draw.choice((0.0, 1.0, -3.0)), draw.choice((0.0, 0.01)), draw.choice((0.0, 1e-3, float("inf"))))
        one = meet(track, clock, limits, draw.choice((None, 1.0)))
        yield said([one.pairs, one.added, one.missing, one.gain, clock.in_run(7.0), clock.in_capture(7.0)])
        yield said(align([track], draw.choice(([], [replace(track, is_inverted=not track.is_inverted)])), limits))


def levels(draw: random.Random) -> Iterator[str]:
    for _ in range(60):
        at, changes = draw.choice((0.0, 3.0)), list[LevelEdge]()
        for _ in range(draw.randint(0, 7)):
            changes.append((at, draw.choice((0, 1, 2))))
            at += draw.choice((0.0, 1.0, 5.0))
        signal = signal_of(changes, at + 4)
        yield said(
            [changes, signal, [signal.is_unknown(ns, slack) for ns in (0.0, 1.0, 4.0, 9.0) for slack in (0.0, 1.0)]]
        )
    for words in (
        "24 MHz",
        "24MHz",
        "500000",
        "500 kHz",
        "1.5 GHz",
        "1 K",
        "0",
        "1e6",
        "1001 GHz",
        "1000 GHz",
        "",
        "MHz",
        "24 mHz",
        " 5 Hz ",
    ):
        yield tried(rate_of, words)
    for text in (
        "Acquisition with 8/8 channels at 24 MHz",
        "samplerate: 500 kHz",
        "samplerate=1.5GHz",
        "at 100 Hz",
        "AT 3 mhz",
        "SampleRate 7Hz",
        "none",
        "at  MHz",
    ):
        yield tried(rate_in_words, text)
    for rate in (*RATES_HZ, 3.7e6):
        times = [n * 1e9 / rate for n in (0, 1, 3, 4, 9, 11, 12, 20, 33, 47, 51, 60)]
        yield said(
            [
                rate,
                rate_of_times(times),
                rate_of_times(times[:11]),
                rate_of_times([at + draw.choice((0.0, 0.9)) for at in times]),
                rate_of_times([at + 100.0 for at in times] * 2),
                rate_of_times([*times, times[-1] + 1.2]),
            ]
        )


VCD = """$date today $end
$timescale 1 ns $end
$comment Acquisition at 24 MHz $end
$scope module a $end
$var wire 1 ! PA0 $end
$var wire 1 " PA1 $end
$var wire 9 # word $end
$scope module b $end
$var reg 1 % PA0 $end
$var real 1 & volts $end
$var wire 4 + nibble $end
$upscope $end
$upscope $end
$enddefinitions $end
#0
$dumpvars
0!
x"
bx #
z%
$end
#10 1! 1" b101 #
#20
0! r1.5 &
1+
1%
#25
Z"
#40
"""
SALEAE = """Time [s],Channel 0,Channel 1
-0.000001,0,1
0.000000,1,1

0.0000005,1,0
0.000002000,0,1
0.000003,0,1
"""


def files(draw: random.Random) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a"

        def shown(text: bytes, *, rate: float = 0.0, is_capture: bool = True) -> str:
            path.write_bytes(text)
            return tried(read_waveforms, path, rate, is_capture=is_capture).replace(folder, "…")

        for text in (VCD, SALEAE):
            lines = text.splitlines()
            yield (
                shown(text.encode())
                + shown(b"\xef\xbb\xbf  " + text.encode(), rate=1e6)
                + shown(text.encode(), is_capture=False)
            )
            for number, line in enumerate(lines):
                without = "\n".join(lines[:number] + lines[number + 1 :])
                yield shown(without.encode())
                for _ in range(2):
                    at = draw.randrange(len(line) + 1)
                    other = line[:at] + draw.choice('019x $#,.-"eE') + line[at + draw.choice((0, 1)) :]
                    yield f"{other}: " + shown("\n".join([*lines[:number], other, *lines[number + 1 :]]).encode())
        for scale in ("1 s", "10 ms", "100us", "1 ps", "10 fs", "5 ns", "1 m"):
            yield shown(VCD.replace("1 ns", scale).encode())
        yield shown(b"META a b\n" + VCD.replace("at 24 MHz", "").encode())
        for text in (
            b"",
            b"Time [s]\n",
            b"time[s], a\n1,0\n",
            b"Time [s],a,a\n",
            b"Time [ms],a\n",
            b"Time [s],a\n",
            b"Time [s],a\ninf,0\n",
            b"Time [s],a\n1,2\n",
            b"Time [s],a\n1,0,1\n",
            b"Time [s],a\n2,0\n1,1\n",
            b"Time [s],a\n2,0\n2,1\n",
            b'Time [s],a\n"2,0\n',
            b"nothing",
            b"PK\3\4",
            b"$end",
        ):
            yield shown(text)


def sessions(draw: random.Random) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.sr"

        def shown(metadata: str, pieces: dict[str, bytes], number: str = "2") -> str:
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("version", number)
                archive.writestr("metadata", metadata)
                for name, data in pieces.items():
                    archive.writestr(name, data)
            return tried(read_waveforms, path).replace(folder, "…")

        head = "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\ntotal probes=3\n"
        head += "samplerate=2 MHz\nprobe1=a\nprobe3=c\nprobe9=i\nunitsize=2\n"
        data = bytes((0, 0, 1, 0, 5, 1, 5, 1, 4, 0, 4, 1, 2, 1))
        yield shown(head, {"logic-1": data}) + shown(
            head, {"logic-1-1": data[:6], "logic-1-2": data[6:], "logic-1-10": data[:2]}
        )
        yield (
            shown(head, {"logic-1-1": data[:5], "logic-1-2": data[5:]})
            + shown(head, {"logic-1": data[:-1]})
            + shown(head, {"logic-1": b""})
        )
        for one, other in (
            ("unitsize=2", "unitsize=1"),
            ("unitsize=2", "unitsize=0"),
            ("unitsize=2", "unitsize=16"),
            ("unitsize=2", "unitsize=17"),
            ("unitsize=2", "unitsize=x"),
            ("probe9=i", "probe16=i"),
            ("probe9=i", "probe17=i"),
            ("probe9=i", "probe09=i"),
            ("probe1=a\nprobe3=c\nprobe9=i\n", ""),
            ("2 MHz", "0"),
            ("2 MHz", "24 kHz"),
            ("samplerate", "rate"),
            ("capturefile=logic-1", "capturefile=x"),
            ("[device 1]", "[device 2]"),
            ("[device 1]", "[other]"),
        ):
            yield shown(head.replace(one, other), {"logic-1": data})
        yield (
            shown(head, {"logic-10": data})
            + shown(head, {})
            + shown(head, {"logic-1": data}, "1")
            + shown(head, {"logic-1": data}, "3")
        )
        for size in (3, 4, 7, 1 << 20):  # blocks that end within a sample, and within a change
            before, sigrok_reader._BLOCK = sigrok_reader._BLOCK, size
            yield shown(head, {"logic-1-1": data, "logic-1-2": data[1:]})
            sigrok_reader._BLOCK = before
        before_bytes, sigrok_reader.MOST_BYTES = sigrok_reader.MOST_BYTES, 14
        yield shown(head, {"logic-1": data}) + shown(head, {"logic-1": data + b"\0"})
        sigrok_reader.MOST_BYTES = before_bytes
        for probes in (1, 8, 9, 17):
            names = [f"P{n}" for n in range(probes)]
            for rate_hz in RATE_NAMES:
                unit = max(1, (probes + 7) // 8)
                write_session(path, names, rate_hz, [draw.randbytes(unit * 5), draw.randbytes(unit)])
                yield said(
                    [rate_hz, {name: (one.first, len(one.edges)) for name, one in read_waveforms(path).signals.items()}]
                )
        for _ in range(30):
            edges = sorted(
                (draw.randrange(0, 900), draw.randrange(3), draw.choice((0, 1, 2, 3)))
                for _ in range(draw.randint(0, 9))
            )
            yield said(
                [[*runs(edges, draw.randrange(8), 1000, rate_hz)] for rate_hz in (10_000_000, 3_000_000, 1_000_000)]
            )
        yield said(
            [sample_at(ns, rate) for ns in (0, 1, 49, 50, 51, 1000) for rate in RATE_NAMES]
            + [identifier(n) for n in (0, 1, 93, 94, 95, 187, 188, 8929, 8930)]
        )
        yield from recordings(draw, Path(folder))


def recordings(draw: random.Random, folder: Path) -> Iterator[str]:
    for span in (1000, 799_999_999, 800_000_001, 20_000_000_000, 900_000_000_000, 1_600_000_000_000):
        names = ["PA0", "PA1", "PA2", "irq.USART1", "usart1.tx", "usart1.word", "usart2.word"]
        log = EdgeLog([0, 1, 2, 3], [0, 1, 2, 0, 0])
        at = 100
        for _ in range(12):
            at += draw.choice((1, 50, span // 40))
            log.put(at, draw.choice((0, 1, 3, 4, 5)), draw.choice((0, 1)))
        edges: dict[str, list[tuple[int, int]]] = {}
        for when, number, value in log.rows():
            edges.setdefault(names[number], []).append((when, value))
        probe = SimpleNamespace(
            names=names,
            first_word=5,
            start_ns=100,
            end_ns=100 + span,
            initial={"PA0": 0, "PA1": 1, "PA2": 2, "irq.USART1": 0, "usart1.tx": 1},
            log=log,
            edges=edges,
        )
        for name, write in (("a.sr", write_sigrok), ("a.vcd", write_vcd)):
            yield tried(written, write, probe, folder / name)


def written(write: Callable[..., None], probe: object, path: Path) -> str:
    write(probe, path)
    if path.suffix == ".vcd":
        return path.read_text(encoding="ascii")
    with zipfile.ZipFile(path) as archive:
        entries = [
            (one.filename, one.date_time, one.compress_type, one.file_size, one.CRC) for one in archive.infolist()
        ]
        return said([archive.read("version"), archive.read("metadata").decode(), entries])


TRACES: dict[str, Trace] = {
    "comparisons": comparisons,
    "meetings": meetings,
    "levels": levels,
    "files": files,
    "sessions": sessions,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
