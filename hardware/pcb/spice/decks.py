"""Every question that the simulator is asked, in the order of docs/board-simulation.md.

Circuits are the netlist's own (netlist.py): values, topology and polarity come from the design.
"""

from hardware.pcb.circuit.design import build
from hardware.pcb.spice.deck import Deck
from hardware.pcb.spice.signal_decks import signal_decks
from hardware.pcb.spice.supply_decks import supply_decks
from hardware.pcb.spice.thermal_decks import thermal_decks


def decks() -> tuple[Deck, ...]:
    """Return every simulation of the board."""
    buck, linear, ribbon = build("rev-b"), build("lm317"), build("rev-c")
    return (*signal_decks(buck), *supply_decks(buck, linear, ribbon), *thermal_decks(buck))
