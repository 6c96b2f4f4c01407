"""Files of waveforms of each format, as other programs write them; damaged ones are refused in a line."""

import contextlib
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.analysis.waveforms.levels import CaptureError, LevelEdge
from bluepill_sim.analysis.waveforms.reading import read_waveforms
from bluepill_sim.analysis.waveforms.sample_rate import rate_in_words, rate_of, rate_of_times
from bluepill_sim.analysis.waveforms.sigrok_writer import write_session
from simbase.errors import FileError

SIGROK_CLI = shutil.which("sigrok-cli")
VCD = """$date today $end
$version some simulator $end
$comment
  Acquisition with 2/8 channels at 4 MHz
$end
$timescale 1 us $end
$scope module top $end
$var wire 1 ! D0 $end
$var wire 1 " D1 $end
$var reg 9 # word [8:0] $end
$var real 64 % volts $end
$upscope $end
$enddefinitions $end
#10
$dumpvars
0!
x"
bx #
r1.5 %
$end
#12 1! b101 #
#13 1"
#20 0! 1!
#21 0!
#30
"""
SALEAE_2 = "Time [s],Channel 0,Channel 1\n-0.000001000,0,1\n0.000002000,1,1\n0.000003000,1,0\n0.000010000,0,0\n"
SALEAE_1 = "Time[s], Channel 0, Channel 1\n0.000000000000000, 0, 1\n0.000002000000000, 1, 0\n"
METADATA = """[global]
sigrok version=0.6.0

[device 1]
capturefile=logic-1
total probes=2
samplerate=2 MHz
total analog=0
probe1=D0
probe3=RX
unitsize=1
"""


def edges(path: Path) -> Mapping[str, list[LevelEdge]]:
    return {name: list(signal.edges) for name, signal in read_waveforms(path).signals.items()}


def session(path: Path, *, metadata: str = METADATA, pieces: Mapping[str, bytes], version: str = "2") -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("version", version)
        if metadata:
            archive.writestr("metadata", metadata)
        for name, data in pieces.items():
            archive.writestr(name, data)
    return path


def test_a_vcd(tmp_path: Path) -> None:
    path = tmp_path / "a.vcd"
    path.write_text(VCD)
    found = read_waveforms(path)
    assert (found.start_ns, found.end_ns, found.sample_ns) == (10_000, 30_000, 250)
    assert edges(path) == {"D0": [(12_000, 1), (21_000, 0)], "D1": []}
    assert found.signals["D0"].first == 0
    assert found.signals["D1"].unknown == [(10_000, 13_000)]


def test_names_of_a_vcd_that_stand_in_two_scopes(tmp_path: Path) -> None:
    path = tmp_path / "a.vcd"
    path.write_text(
        "$timescale 10 ns $end $scope module a $end $var wire 1 ! x $end $upscope $end $scope module b $end "
        "$var wire 1 ' x $end $upscope $end $enddefinitions $end #0 0! 1' #3 1! #4\n"
    )
    assert edges(path) == {"a.x": [(30, 1)], "b.x": []}


@pytest.mark.parametrize(("text", "start"), [(SALEAE_2, -1000.0), (SALEAE_1, 0.0)])
def test_csv_of_both_versions_of_saleae(tmp_path: Path, text: str, start: float) -> None:
    path = tmp_path / "digital.csv"
    path.write_text(text)
    found = read_waveforms(path)
    assert found.start_ns == pytest.approx(start)
    assert found.signals["Channel 0"].edges[0] == (pytest.approx(2_000), 1)
    assert found.signals["Channel 1"].first == 1
    assert read_waveforms(path, 4e6).sample_ns == 250


@pytest.mark.parametrize("pieces", [
    {"logic-1": bytes((0, 1, 1, 4, 4, 0))},
    {"logic-1-1": bytes((0, 1)), "logic-1-2": bytes((1, 4, 4, 0))},
    {"logic-1-10": bytes((4, 0)), "logic-1-9": bytes((0, 1, 1, 4))},
    {"logic-1": bytes((0, 3, 1, 6, 4, 2))},  # an unnamed probe moves too
])  # fmt: skip
def test_a_sigrok_session_whole_or_in_pieces(tmp_path: Path, pieces: Mapping[str, bytes]) -> None:
    path = session(tmp_path / "a.sr", pieces=pieces)
    found = read_waveforms(path)
    assert edges(path) == {"D0": [(500, 1), (1500, 0)], "RX": [(1500, 1), (2500, 0)]}
    assert (found.sample_ns, found.end_ns) == (500, 2500)


def test_samples_of_two_bytes_in_pieces_that_split_one(tmp_path: Path) -> None:
    metadata = METADATA.replace("unitsize=1", "unitsize=2").replace("probe3", "probe9")
    path = session(tmp_path / "a.sr", metadata=metadata, pieces={"logic-1-1": b"\0\0\1", "logic-1-2": b"\1\0\1\1\0"})
    assert edges(path) == {"D0": [(500, 1), (1000, 0), (1500, 1)], "RX": [(500, 1), (1500, 0)]}


@settings(max_examples=60)
@given(st.lists(st.integers(0, 1023), min_size=1, max_size=300), st.integers(1, 2))
def test_what_our_own_writer_writes_is_read_back(samples: list[int], repeat: int) -> None:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.sr"
        levels = [sample for sample in samples for _ in range(repeat)]
        write_session(path, [f"p{n}" for n in range(10)], 1_000_000, [each.to_bytes(2, "little") for each in levels])
        found = read_waveforms(path)
    for probe in range(10):
        bits = [level >> probe & 1 for level in levels]
        expected = [(1000.0 * n, bit) for n, bit in enumerate(bits) if n and bit != bits[n - 1]]
        signal = found.signals[f"p{probe}"]
        assert (signal.first, list(signal.edges)) == (bits[0], expected)


@pytest.mark.skipif(SIGROK_CLI is None, reason="sigrok-cli is not installed")
@pytest.mark.parametrize("ending", ["sr", "vcd"])
def test_what_sigrok_writes_is_read(tmp_path: Path, ending: str) -> None:
    source, made = tmp_path / "in.bin", tmp_path / f"out.{ending}"
    bits = [0, 0, 1, 1, 1, 0, 1, 0, 0, 0, 1, 1]
    source.write_bytes(bytes(bit | (bit ^ 1) << 1 for bit in bits))
    subprocess.run(
        [str(SIGROK_CLI), "-I", "binary:numchannels=3:samplerate=8000000", "-i", str(source),
         "-O", "srzip" if ending == "sr" else "vcd", "-o", str(made)],
        check=True, timeout=30, capture_output=True,
    )  # fmt: skip
    found = read_waveforms(made)
    assert found.sample_ns == 125
    names = list(found.signals)
    assert len(names) == 3
    expected = [(125.0 * n, bit) for n, bit in enumerate(bits) if n and bit != bits[n - 1]]
    assert list(found.signals[names[0]].edges) == expected
    assert [level for _, level in found.signals[names[1]].edges] == [level ^ 1 for _, level in expected]
    assert found.signals[names[1]].first == 1


DAMAGED = {
    "empty": b"",
    "text": b"hello\n",
    "zip": b"PK\x03\x04nothing",
    "vcd level": VCD.encode().replace(b"#12 1!", b"#12 7!"),
    "vcd code": VCD.encode().replace(b"#12 1!", b"#12 1?"),
    "vcd time": VCD.encode().replace(b"#13", b"#3"),
    "vcd scale": VCD.encode().replace(b"1 us", b"7 us"),
    "vcd cut": b"$date today",
    "vcd none": b"$date $end #1\n",
    "vcd upscope": b"$upscope $end",
    "vcd scope": b"$scope $end",
    "vcd var": b"$var wire $end",
    "csv head": b"Time [s]\n1\n",
    "csv iso": b"Time,D0\n2026-01-01T00:00:00,1\n",
    "csv empty": b"Time [s],D0\n",
    "csv level": b"Time [s],D0\n0,2\n",
    "csv width": b"Time [s],D0\n0,1,1\n",
    "csv time": b"Time [s],D0\nnan,1\n",
    "csv backwards": b"Time [s],D0\n1,1\n0,0\n",
    "csv twice": b"Time [s],D0,D0\n1,1,0\n",
    "csv words": b"Time [s],D0\n1,on\n",
}


@pytest.mark.parametrize("name", DAMAGED)
def test_what_is_none_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / "x"
    path.write_bytes(DAMAGED[name])
    with pytest.raises(CaptureError) as caught:
        read_waveforms(path)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)
    assert caught.value.hint


@pytest.mark.parametrize(("metadata", "pieces"), [
    ("", {"logic-1": b"\0"}), ("no ini at all", {"logic-1": b"\0"}), (METADATA, {}), (METADATA, {"logic-1": b""}),
    (METADATA.replace("2 MHz", "fast"), {"logic-1": b"\0"}), (METADATA.replace("unitsize=1", ""), {"logic-1": b"\0"}),
    (METADATA.replace("unitsize=1", "unitsize=0"), {"logic-1": b"\0"}),
    (METADATA.replace("probe3", "probe9"), {"logic-1": b"\0"}),
    (METADATA.replace("probe", "analog"), {"logic-1": b"\0"}),
])  # fmt: skip
def test_a_session_that_is_none_is_refused(tmp_path: Path, metadata: str, pieces: Mapping[str, bytes]) -> None:
    with pytest.raises(CaptureError, match=r"a\.sr"):
        read_waveforms(session(tmp_path / "a.sr", metadata=metadata, pieces=pieces))


def test_a_session_of_which_bytes_are_missing_is_refused(tmp_path: Path) -> None:
    path = session(tmp_path / "a.sr", pieces={"logic-1": bytes(range(250)) * 40})
    whole = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        at = archive.getinfo("logic-1").header_offset + 80
    path.write_bytes(whole[:at] + bytes((whole[at] ^ 0xFF,)) + whole[at + 1 :])
    with pytest.raises(CaptureError, match="damaged"):
        read_waveforms(path)
    with pytest.raises(FileError):
        read_waveforms(tmp_path / "none.sr")


@settings(max_examples=60)
@given(st.data())
def test_a_file_with_any_damage_is_read_or_refused(data: st.DataObject) -> None:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "x"
        which = data.draw(st.integers(0, 2))
        if which == 2:
            session(path, pieces={"logic-1": bytes((0, 1, 1, 4, 4, 0))})
            text = bytearray(path.read_bytes())
        else:
            text = bytearray((VCD, SALEAE_2)[which].encode())
        for _ in range(data.draw(st.integers(1, 4))):
            text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
        path.write_bytes(text[: data.draw(st.integers(1, len(text)))])
        with contextlib.suppress(CaptureError, FileError):
            read_waveforms(path)


def test_the_rate_is_seen_in_the_times() -> None:
    times = [round(n * 1e9 / 24e6) for n in (0, 5, 6, 11, 40, 41, 100, 1001, 1002, 70_007, 70_008, 90_001, 1_000_003)]
    assert rate_of_times(times) == 24e6
    assert rate_of_times([*times, times[-1] + 14]) == 0.0 or rate_of_times([*times, times[-1] + 14]) > 24e6
    assert rate_of_times(times[:5]) == 0.0
    assert rate_in_words("Acquisition with 8/8 channels at 24 MHz") == 24e6
    assert rate_in_words("nothing") == 0.0
    assert [rate_of(words) for words in ("24 MHz", "500kHz", "1000000", "1GHz")] == [24e6, 5e5, 1e6, 1e9]
    for words in ("", "fast", "0 MHz", "-1", "9e99", "1e5000"):
        with pytest.raises(ValueError, match="sample rate"):
            rate_of(words)
