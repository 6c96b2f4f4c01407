"""The adapter board as code: one design, from which every file of the board is generated.

`python -m hardware.pcb` builds, checks, routes and simulates. Source of truth:
`circuit/parts` (what can be bought), `circuit/design` (components and nets, from
adapter_sim/pinout.toml), `layout/placement` (where they stand), `layout/rules` (widths
and distances) and `routes/*.txt` (the router's result, kept as data).

No board has been made from these files yet.
"""
