"""Reads a file of waveforms of whichever format: a table of formats, told by how a file begins."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from bluepill_sim.analysis.waveforms.levels import CaptureError, Waveforms
from bluepill_sim.analysis.waveforms.saleae_reader import read_saleae
from bluepill_sim.analysis.waveforms.sample_rate import rate_of_times
from bluepill_sim.analysis.waveforms.sigrok_reader import read_sigrok
from bluepill_sim.analysis.waveforms.vcd_reader import read_vcd
from simbase.files import reading

#: By the first bytes of a file, blanks before them aside, in lower case.
FORMATS: Mapping[bytes, Callable[[Path], Waveforms]] = {
    b"pk\x03\x04": read_sigrok,
    b"$": read_vcd,
    b"meta ": read_vcd,  # sigrok-cli's begins with a line of its own
    b"time": read_saleae,
}
#: For people.
KNOWN = "a sigrok session (.sr), a value change dump (.vcd), Saleae's CSV"


def read_waveforms(path: Path, rate_hz: float = 0.0, *, is_capture: bool = True) -> Waveforms:
    """Read a file.

    Args:
        path: The file.
        rate_hz: Samples a second, where whoever reads it knows better than the file; 0: as the file has it.
        is_capture: Whether a sampling analyser made it, so that a file that does not tell the rate shows it.

    Raises:
        CaptureError: It is of none of the formats, or is damaged.
        FileError: It cannot be read.
    """
    with reading(path), path.open("rb") as file:
        begins = file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    for beginning, read in FORMATS.items():
        if begins.startswith(beginning):
            found = read(path)
            break
    else:
        raise CaptureError(f"{path} is no file of waveforms", hint=f"known: {KNOWN}")
    if rate_hz:
        return replace(found, sample_ns=1e9 / rate_hz, rate_from="--rate")
    if found.rate_from or not is_capture:
        return found
    shown_hz = rate_of_times(at for signal in found.signals.values() for at, _ in signal.edges)
    return replace(found, sample_ns=1e9 / shown_hz if shown_hz else found.sample_ns, rate_from="the times")
