"""What makers' order numbers say: value, voltage, tolerance and package, read from the number alone.

One row a maker's series: a pattern, the codes in it, and where the code was read. A part of the catalogue is held
against what its own number says: SMBJ5.0A ordered as a 15 V suppressor, or 470 ohm as 4k7, has a line here. Of a maker
that numbers without a code, the row is the article itself, and the part's question to the distributor stands for it.

Invariant: `decode` never looks at the part, so that number and part cannot agree by construction.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from hardware.pcb.circuit.parts import Part

#: A figure, or a word such as the package's name.
Fact = float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """How one maker numbers one series."""

    maker: str
    #: Named groups are codes; all of the number must match.
    pattern: str
    #: Group to its fact's name and its codes; a group without a row only has to match.
    codes: Mapping[str, tuple[str, Mapping[str, Fact]]] = field(default_factory=dict)
    #: Groups that are figures: to the fact's name and the reader.
    figures: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    #: What every number of the series has.
    fixed: Mapping[str, Fact] = field(default_factory=dict)
    #: Sheet, and whether it was seen.
    source: str


class UnreadableError(ValueError):
    """A number matches no series of its maker, or has a code that the series does not have."""


def decode(maker: str, number: str) -> dict[str, Fact]:
    """Return the facts that an order number states.

    Raises:
        UnreadableError: No series of this maker has such a number.
    """
    for series in SERIES:
        if series.maker == maker and (found := re.fullmatch(series.pattern, number)):
            return dict(_facts(series, number, found))
    raise UnreadableError(f"{number!r} is no order number of {maker}")


def disagreements(part: Part) -> list[str]:
    """Return where a part differs from its own order number: value, description, facts, footprint; one line each."""
    try:
        said = decode(part.manufacturer, part.mpn)
    except UnreadableError as error:
        return [str(error)]
    found = []
    for name, wanted in said.items():
        found += [
            f"{part.mpn} says {name} {_shown(wanted)}, {where} {_shown(value)}"
            for where, value in _stated(part, name, wanted)
            if not _same(value, wanted)
        ]
    return found


def _facts(series: Series, number: str, found: re.Match[str]) -> Iterator[tuple[str, Fact]]:
    yield from series.fixed.items()
    for group, (name, codes) in series.codes.items():
        code = found[group]
        if code not in codes:
            raise UnreadableError(f"{number!r}: {code!r} is no code for {name} ({series.source})")
        yield name, codes[code]
    for group, (name, reader) in series.figures.items():
        yield name, _READERS[reader](found[group])


def _stated(part: Part, name: str, wanted: Fact) -> Iterator[tuple[str, Fact]]:
    """Yield what a part itself states of a fact, and where."""
    if name in part.facts:
        yield "the part's facts have", part.facts[name]
    if name == "package":
        yield "its footprint is for", PACKAGES.get(part.footprint, part.footprint)
        return
    if name == "symbol":
        yield "its symbol is", part.symbol
        return
    if name in {"type", "colour"}:
        yield "its value is", part.value
        return
    for where, text in (("its value is", part.value), ("its description says", part.description)):
        figures = list(_figures(name, text))
        # A text may have other figures of the unit: what a fuse trips at beside what it holds.
        good = [figure for figure in figures if _same(figure, wanted)]
        yield from ((where, figure) for figure in good or figures[:1])


def _figures(name: str, text: str) -> Iterator[float]:
    """Yield the figures of a fact's unit that stand in a text: `35 V`, `100nF`, `4k7`."""
    if name == "ohm":
        yield from (_letter_as_point(word.upper()) for word in re.findall(r"(?<![\w.])\d+[Rk]\d*(?!\w)", text))
    if name in _UNITS:
        unit, factor = _UNITS[name]
        for figure, prefix in re.findall(rf"(?<![\w.])([\d.]+) ?([unkm]?){unit}(?!\w)", text):
            yield float(figure) * _PREFIX[prefix] * factor


def _same(value: Fact, wanted: Fact) -> bool:
    if isinstance(value, str) or isinstance(wanted, str):
        return value == wanted
    return abs(value - wanted) <= 1e-6 * abs(wanted)


def _shown(value: Fact) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _letter_as_point(text: str) -> float:
    """Read 4K7, 470R, 20K, 1K."""
    (letter,) = re.findall(r"[RKM]", text)
    return float(text.replace(letter, ".").rstrip(".")) * {"R": 1.0, "K": 1e3, "M": 1e6}[letter]


def _three_digits(text: str) -> float:
    """Read 104 as 10 with four noughts, picofarads."""
    return float(text[:2]) * 10.0 ** int(text[2]) * 1e-12


def _rows(text: str) -> str:
    """Read 0242 as 24 pins in 2 rows: 2x12."""
    pins, rows = int(text[:3]), int(text[3])
    return f"{rows}x{pins // rows}"


_READERS: Mapping[str, Callable[[str], Fact]] = {
    "letter": _letter_as_point, "picofarads": _three_digits, "microfarads": lambda text: 1e6 * _three_digits(text),
    "plain": float, "hundredths": lambda text: float(text) / 100, "tens": lambda text: 10 * float(text),
    "word": str, "rows": _rows, "box": lambda text: f"{_rows(text)} box",
    "socket": lambda text: f"socket {_rows(text)}", "poles": lambda text: f"VH {text}",
}  # fmt: skip
#: Facts that value and description state as figures: the unit, and what it is in the facts' unit.
_UNITS: Mapping[str, tuple[str, float]] = {
    "voltage_v": ("V", 1.0), "voltage_max_v": ("V", 1.0), "standoff_v": ("V", 1.0), "reverse_v": ("V", 1.0),
    "output_v": ("V", 1.0), "current_a": ("A", 1.0), "hold_a": ("A", 1.0), "output_max_ma": ("A", 1e3),
    "farad": ("F", 1.0), "tolerance": ("%", 0.01),
}  # fmt: skip
_PREFIX = {"": 1.0, "u": 1e-6, "n": 1e-9, "k": 1e3, "m": 1e-3}

#: Footprint: the package that fits it.
PACKAGES = {
    "R_0805": "0805", "C_0805": "0805", "LED_0805": "0805", "C_1206": "1206", "F_1812": "1812", "D_SMA": "SMA",
    "D_SMB": "SMB", "SOIC16": "SOIC-16", "SOT23": "SOT-23", "SOT223": "SOT-223", "SIP3_BUCK": "SIP-3",
    "JST_VH_2": "VH 2", "HEADER_1X2": "1x2", "HEADER_1X3": "1x3", "HEADER_2X12": "2x12", "IDC_2X5": "2x5 box",
    "CP_RADIAL_D6": "radial", "TERMINAL_5.08": "2 x 5.08", "SW_PUSH_6MM": "6 mm", "DE9_MALE": "DE-9 plug, .318",
}  # fmt: skip

_METRIC = {"0402": "0402", "0603": "0603", "0805": "0805", "1206": "1206"}
_TOLERANCE: Mapping[str, Fact] = {"B": 0.001, "D": 0.005, "F": 0.01, "J": 0.05}
_VOLTS_JIS: Mapping[str, Fact] = {"0J": 6.3, "1A": 10.0, "1C": 16.0, "1E": 25.0, "1V": 35.0, "1H": 50.0, "1J": 63.0}
_VOLTS_YAGEO: Mapping[str, Fact] = {"5": 6.3, "6": 10.0, "7": 16.0, "8": 25.0, "9": 50.0}

SERIES: tuple[Series, ...] = (
    Series(
        maker="Yageo",
        pattern=r"RC(?P<size>\d{4})(?P<tolerance>[BDFJ])[RKS]-(07|10|13)(?P<ohm>[\dRKM]{2,5})L",
        codes={"size": ("package", _METRIC), "tolerance": ("tolerance", _TOLERANCE)},
        figures={"ohm": ("ohm", "letter")},
        source="Yageo RC_L V.9 (2018), global part number, seen",
    ),
    Series(
        maker="Yageo",
        pattern=r"CC(?P<size>\d{4})[JKM][RKPFC](X7R|X5R|NPO)(?P<volts>\d)(BB|BN)(?P<farad>\d{3})",
        codes={"size": ("package", _METRIC), "volts": ("voltage_v", _VOLTS_YAGEO)},
        figures={"farad": ("farad", "picofarads")},
        source="Yageo CC X7R V.10 (2014), global part number, seen",
    ),
    Series(
        maker="Murata",
        pattern=r"GRM(?P<size>\d\d)\w(R6|R7|5C)(?P<volts>\d\w)(?P<farad>\d{3})[JKM]\w{2,3}\w",
        codes={
            "size": ("package", {"15": "0402", "18": "0603", "21": "0805", "31": "1206", "32": "1210"}),
            "volts": ("voltage_v", _VOLTS_JIS),
        },
        figures={"farad": ("farad", "picofarads")},
        source="Murata C02E, part numbering and GRM31C's size, seen",
    ),
    Series(
        maker="Panasonic",
        pattern=r"EEU-?(FR|FM|FC)(?P<volts>\d\w)(?P<farad>\d{3})[A-Z]?",
        codes={"volts": ("voltage_v", _VOLTS_JIS)},
        figures={"farad": ("farad", "microfarads")},
        fixed={"package": "radial"},
        source="Panasonic radial lead types, explanation of part numbers, seen",
    ),
    Series(
        maker="Littelfuse",
        pattern=r"(?P<type>SMBJ(?P<volts>[\d.]+)(?P<way>A|CA))",
        codes={"way": ("polarity", {"A": "one way", "CA": "both ways"})},
        figures={"volts": ("standoff_v", "plain"), "type": ("type", "word")},
        fixed={"package": "SMB"},
        source="Littelfuse TVS catalogue 2013 (SMBJ = DO-214AA), AVX SMBJ how to order (A = one way), seen",
    ),
    Series(
        maker="Littelfuse",
        pattern=r"1812L(?P<hold>\d{3})/(?P<volts>\d+)[A-Z]{0,2}",
        figures={"hold": ("hold_a", "hundredths"), "volts": ("voltage_max_v", "plain")},
        fixed={"package": "1812"},
        source="Littelfuse 1812L (2019), table, seen",
    ),
    Series(
        maker="Bourns",
        pattern=r"MF-MSMF(?P<hold>\d{3})/(?P<volts>\d+)X?-2",
        figures={"hold": ("hold_a", "hundredths"), "volts": ("voltage_max_v", "plain")},
        fixed={"package": "1812"},
        source="Bourns MF-MSMF, table, seen",
    ),
    Series(
        maker="Diodes Incorporated",
        pattern=r"(?P<type>B(?P<amps>\d)(?P<volts>\d)0(?P<case>[AB]))-13-F",
        codes={"case": ("package", {"A": "SMA", "B": "SMB"})},
        figures={"volts": ("reverse_v", "tens"), "amps": ("current_a", "plain"), "type": ("type", "word")},
        source="Diodes B320A - B360A, ordering information, seen",
    ),
    Series(
        maker="onsemi",
        pattern=r"(?P<type>MBRA(?P<amps>\d)(?P<volts>\d\d)(?P<drop>[EL]))T3G",
        codes={"drop": ("drop", {"L": "low drop", "E": "low leakage"})},
        figures={"volts": ("reverse_v", "plain"), "amps": ("current_a", "plain"), "type": ("type", "word")},
        fixed={"package": "SMA"},
        source="onsemi MBRA210LT3/D, seen",
    ),
    Series(
        maker="Texas Instruments",
        pattern=r"(?P<type>(?P<family>MAX\d+)E?)(C|I)(?P<case>DW|D|PW|DB|N)R?",
        codes={
            "family": ("supply_min_v", {"MAX3232": 3.0, "MAX232": 4.5, "MAX202": 4.5}),
            "case": (
                "package",
                {"D": "SOIC-16", "DW": "SOIC-16 wide", "PW": "TSSOP-16", "DB": "SSOP-16", "N": "DIP-16"},
            ),
        },
        figures={"type": ("type", "word")},
        source="TI SLLS410 (MAX3232), SLLS723 (MAX232E: C, I, D, DW, PW, N), seen",
    ),
    Series(
        maker="Texas Instruments",
        pattern=r"(?P<type>LM317(?P<case>DCY|KCS|KTT))R?",
        codes={"case": ("package", {"DCY": "SOT-223", "KCS": "TO-220", "KTT": "TO-263"})},
        figures={"type": ("type", "word")},
        source="TI LM317, package option addendum, memory",
    ),
    Series(
        maker="Traco Power",
        pattern=r"(?P<type>TSR 1-24(?P<volts>\d{2,3}))",
        codes={
            "volts": (
                "output_v",
                {
                    "12": 1.2,
                    "15": 1.5,
                    "18": 1.8,
                    "25": 2.5,
                    "33": 3.3,
                    "50": 5.0,
                    "65": 6.5,
                    "90": 9.0,
                    "120": 12.0,
                    "150": 15.0,
                },
            )
        },
        figures={"type": ("type", "word")},
        fixed={"package": "SIP-3", "output_max_ma": 1000.0},
        source="Traco TSR 1 series, table of models, seen",
    ),
    Series(
        maker="Nexperia",
        pattern=r"(?P<type>BC8(?P<kind>[01]7)-(?P<gain>16|25|40)),215",
        codes={
            "kind": ("symbol", {"17": "NPN", "07": "PNP"}),
            "gain": ("hfe_min", {"16": 100.0, "25": 160.0, "40": 250.0}),
        },
        figures={"type": ("type", "word")},
        fixed={"package": "SOT-23"},
        source="Nexperia BC807, BC817, memory",
    ),
    Series(
        maker="Nexperia",
        pattern=r"(?P<type>74(?P<family>HCT?)595)(?P<case>D|PW|DB),118",
        codes={
            "family": ("supply_min_v", {"HC": 2.0, "HCT": 4.5}),
            "case": ("package", {"D": "SOIC-16", "PW": "TSSOP-16", "DB": "SSOP-16"}),
        },
        figures={"type": ("type", "word")},
        source="Nexperia 74HC595; 74HCT595, memory",
    ),
    Series(
        maker="Kingbright",
        pattern=r"KP-(?P<size>\d{4})S(?P<colour>G|Y|R|UR)C(-PRV|K)?",
        codes={
            "size": ("package", {"2012": "0805", "1608": "0603", "3216": "1206"}),
            "colour": ("colour", {"G": "green", "Y": "yellow", "R": "red", "UR": "red"}),
        },
        source="Kingbright KP-2012, memory",
    ),
    Series(
        maker="Wuerth",
        pattern=r"613(?P<shape>\d{4})1121",
        figures={"shape": ("package", "rows")},
        source="Wuerth WR-PHD: pins, rows, memory",
    ),
    Series(
        maker="Wuerth",
        pattern=r"612(?P<shape>\d{4})1621",
        figures={"shape": ("package", "box")},
        source="Wuerth WR-BHD: pins, rows, memory",
    ),
    Series(
        maker="Wuerth",
        pattern=r"613(?P<shape>\d{4})1821",
        figures={"shape": ("type", "socket")},
        source="Wuerth WR-PHD sockets: pins, rows, memory",
    ),
    Series(maker="Wuerth", pattern=r"609002\d{5}", fixed={"type": "jumper"}, source="Wuerth jumpers, memory"),
    Series(
        maker="JST",
        pattern=r"B(?P<poles>\d+)P-VH",
        figures={"poles": ("package", "poles")},
        source="JST VH, as KiCad's footprint JST_VH_B2P-VH",
    ),
    Series(maker="JST", pattern=r"VHR-2N", fixed={"type": "VH housing"}, source="JST VH, memory"),
    Series(
        maker="TE Connectivity",
        pattern=r"5747840-\d",
        fixed={"package": "DE-9 plug, .318"},
        source="two public footprints (proof/footprints.toml): 9-way plug, right angle, through hole",
    ),
    Series(
        maker="Phoenix Contact",
        pattern=r"1729128",
        fixed={"package": "2 x 5.08"},
        source="an article number, memory",
    ),
    Series(
        maker="generic",
        pattern=r"BluePill STM32F103C8T6|MH-ET LIVE MiniKit ESP32",
        source="the names that modules have",
    ),
    Series(
        maker="Omron",
        pattern=r"B3F-10(?P<force>\d)\d",
        fixed={"package": "6 mm"},
        source="KiCad's SW_TH_Tactile_Omron_B3F-100x; the force, memory",
    ),
)
