"""The adapter board as code: one design, from which every file of the board is generated.

`python -m hardware.pcb` builds, checks, routes and simulates. Source of truth:
`parts` (what can be bought), `design` (components and nets, from
adapter_sim/pinout.toml), `placement` (where they stand), `rules` (widths and
distances) and `routes/*.txt` (the router's result, kept as data).

No board has been made from these files yet.
"""
