"""The adapter's enclosure as code: a base and a lid of plain solids, checked against the board that they hold.

`python -m hardware.case` checks and builds. Source of truth: `design` (solids and measures),
`hardware/pcb/layout` (outline, holes, and the bodies of the parts). No case has been
printed from these files yet.
"""
