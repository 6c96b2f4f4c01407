"""The adapter's states as the page draws them: the table of the adapter itself."""

import re

import adapter_sim.adapter
from adapter_sim.adapter import AdapterState
from robot_bench.view.run_tracks import _STATES, _TRANSITIONS

#: Said below the table, for no column is for them.
BESIDE_THE_TABLE = {("RESET", "BOOTING"), ("CLOSING", "IDLE")}


def test_the_transitions_that_are_drawn_are_those_of_the_adapters_table() -> None:
    rows = re.findall(
        rf"^    ({'|'.join(state.name for state in AdapterState)}) +(\S.*)$",
        adapter_sim.adapter.__doc__ or "",
        re.MULTILINE,
    )
    found = {
        (source, cell)
        for source, cells in rows
        for cell in cells.split()
        if cell in AdapterState.__members__ and "·" in cells
    }
    drawn = {(_STATES[one.source].name, _STATES[one.target].name) for one in _TRANSITIONS}
    assert len(found) > len(AdapterState)
    assert drawn == found | BESIDE_THE_TABLE
