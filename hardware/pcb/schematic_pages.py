"""Which part stands where on the schematic's pages, in steps of 1.27 mm.

Each page is a set of framed groups; a frame has a title and words for the reader.
Invariant: every component of every variant has a page and a place on it.
"""

from dataclasses import dataclass

from adapter_sim.pinout import load_pinout
from hardware.pcb.design import PULL_OFFSET, series_wires
from hardware.pcb.netlist import Component, Design, DesignError

#: One step, millimetres: half of KiCad's usual grid, on which all pins lie.
STEP_MM = 1.27
PAGES = ("modules", "signals", "supply", "serial", "test")
TITLES = {
    "modules": "BluePill and ESP32",
    "signals": "Wires between the modules",
    "supply": "Supply",
    "serial": "RS-232, reset, mode",
    "test": "Test points, logic header, holes",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A group on a page: corners in steps, a title, and a note below it."""

    title: str
    left: int
    top: int
    right: int
    bottom: int
    note: str = ""


def page_of(component: Component) -> str:
    """Return the page of a component.

    Raises:
        DesignError: It has none.
    """
    for page, table in _TABLES.items():
        if component.ref in table:
            return page
    raise DesignError(f"{component.ref} has no page in the schematic")


def place_of(component: Component) -> tuple[int, int]:
    """Return the place on its page, in steps."""
    return _TABLES[page_of(component)][component.ref]


def frames(design: Design, page: str) -> list[Frame]:
    """Return the groups of a page."""
    if page == "supply":
        return [*_SUPPLY_FRAMES, *(_LINEAR_FRAMES if design.variant == "lm317" else _BUCK_FRAMES)]
    extra = _REV_C_FRAMES if design.variant == "rev-c" and page == "serial" else []
    return [*_FRAMES[page], *extra]


def _signal_places() -> dict[str, tuple[int, int]]:
    """Return two columns of rows: series resistor, then the pull-down of the same wire."""
    places = {}
    for index in range(len(series_wires(load_pinout()))):
        column, row = divmod(index, 11)
        x, y = 34 + 106 * column, 26 + 9 * row
        places[f"R{index + 1}"] = (x, y)
        places[f"R{index + 1 + PULL_OFFSET}"] = (x + 50, y)
    return places


def _test_points() -> dict[str, tuple[int, int]]:
    return {f"TP{n}": (104 + 44 * ((n - 1) // 6), 30 + 8 * ((n - 1) % 6)) for n in range(1, 13)}


_SUPPLY = {
    "J1": (18, 26), "F1": (34, 25), "D1": (50, 25), "D2": (66, 28), "C1": (78, 28), "C2": (92, 28),
    "J2": (18, 66), "D3": (36, 65), "JP1": (80, 68), "C4": (98, 70),
    "D4": (138, 64), "D5": (138, 74), "R61": (182, 72), "D6": (200, 72),
    # Buck and LM317 share the place: a variant has one of them.
    "U3": (138, 26), "C3": (178, 29),
    "R68": (154, 40), "R69": (172, 40), "C11": (196, 32),
    "U4": (38, 104), "R70": (56, 118), "R71": (74, 118), "C12": (80, 104), "C13": (96, 118),
}  # fmt: skip
_SERIAL = {
    "U5": (64, 40), "C5": (18, 40), "C6": (30, 40), "C7": (96, 40), "C8": (110, 40), "C9": (124, 40), "J3": (156, 40),
    "R62": (46, 82), "R63": (46, 90), "R64": (46, 100), "D7": (60, 100), "R65": (46, 110), "D8": (60, 110),
    "R66": (136, 92), "R67": (136, 104), "Q1": (152, 92), "J5": (30, 136), "R60": (48, 137),
    "U6": (198, 36), "C10": (208, 60), "R72": (194, 90), "D9": (208, 90),
}  # fmt: skip
_TEST = {"J4": (44, 44), **_test_points(), **{f"H{n}": (20 + 20 * n, 118) for n in range(1, 5)}}
_TABLES = {
    "modules": {"U1": (56, 66), "U2": (168, 66)},
    "signals": _signal_places(),
    "supply": _SUPPLY,
    "serial": _SERIAL,
    "test": _TEST,
}

_SUPPLY_FRAMES = [
    Frame(title="12 V input", left=10, top=12, right=112, bottom=46,
          note="Fuse, reverse protection, transient suppressor. 11 to 14.8 V."),
    Frame(title="5 V power bank and choice of source", left=10, top=52, right=112, bottom=88,
          note="JP1 1-2: from 12 V; 2-3: from the power bank. One jumper only."),
    Frame(title="To the modules", left=116, top=52, right=224, bottom=88,
          note="A diode each: neither module's USB feeds the board or the other module."),
    Frame(title="For the rule check: these nets are supplied", left=10, top=136, right=130, bottom=156),
]  # fmt: skip
_BUCK_FRAMES = [
    Frame(title="12 V to 5 V, 1 A", left=116, top=12, right=224, bottom=46,
          note="The 3.3 V of this board comes from the ESP32 module's own regulator.")
]  # fmt: skip
_LINEAR_FRAMES = [
    Frame(title="12 V to 5 V, LM317: 150 mA on average, 250 mA in peaks", left=116, top=12, right=224, bottom=50,
          note="5.02 V; 10.4 mA through the divider: above the minimum load."),
    Frame(title="12 V to 3.3 V, LM317: transceiver and LEDs only", left=10, top=92, right=112, bottom=132,
          note="3.34 V; the ESP32 keeps its own 3.3 V regulator."),
]  # fmt: skip
_REV_C_FRAMES = [
    Frame(title="Distances by shift register", left=174, top=12, right=224, bottom=70),
    Frame(title="Status LED", left=174, top=74, right=224, bottom=118),
]
_FRAMES = {
    "modules": [
        Frame(title="BluePill (USB at the top)", left=10, top=20, right=108, bottom=112),
        Frame(title="ESP32 D1 mini (antenna at the top)", left=114, top=20, right=224, bottom=112,
              note="GPIO6 to 11 carry the module's flash: never connected."),
    ],
    "signals": [
        Frame(title="Series resistors and pull-downs", left=10, top=12, right=224, bottom=128,
              note="_BP: the BluePill's side. 1k2 limits what an unpowered module takes; "
                   "680R at PC13 holds a low against the BluePill's LED. IO5 and IO15 are straps: no pull-down."),
    ],
    "serial": [
        Frame(title="RS-232 at 3.3 V; DIN2 low asserts DTR", left=10, top=12, right=170, bottom=70,
              note="Plug, wired as DTE: straight cable to the robot's HOST socket."),
        Frame(title="UART with activity lights", left=10, top=74, right=100, bottom=118,
              note="A light is on while its line is low: it flickers with data."),
        Frame(title="Reset: PB13 high pulls EN low", left=106, top=74, right=170, bottom=118,
              note="Emitter to ground. The module has its own pull-up at EN."),
        Frame(title="Mode jumper, read at boot only", left=10, top=122, right=100, bottom=144),
    ],
    "test": [
        Frame(title="Logic header: each wire at its receiver", left=10, top=12, right=84, bottom=70,
              note="3.3 V signals. Drive nothing here that a module drives."),
        Frame(title="Test points", left=90, top=12, right=200, bottom=80),
        Frame(title="Mounting holes M3", left=10, top=106, right=112, bottom=130),
    ],
}  # fmt: skip
