"""Draws a profile as a flame graph: one SVG file, no script from elsewhere.

Widths are cycles, callees stand on their callers, exceptions have a colour of
their own. Sleep is left out, so that what the program does can be seen.

Invariant: the same profile gives the same bytes.
"""

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape

from bluepill_sim.analysis.cycle_profile import ASLEEP

_WIDTH, _ROW, _MARGIN, _TOP = 1200, 20, 12, 52
#: Narrower boxes are left out; texts need a little more room.
_LEAST_PX, _LEAST_TEXT_PX, _CHARACTER_PX = 0.3, 24, 6.7
_STYLE = (
    "text{font:12px ui-monospace,Menlo,Consolas,monospace;fill:#1b1b1b}"
    "text.title{font:600 16px system-ui,sans-serif}text.sub{font:12px system-ui,sans-serif;fill:#555}"
    "rect{rx:2}g:hover rect{stroke:#222;stroke-width:1}"
)


@dataclass(slots=True)
class _Box:
    name: str
    cycles: int = 0
    inner: "dict[str, _Box]" = field(default_factory=dict)


def flame_svg(stacks: Mapping[tuple[str, ...], int], *, title: str, hz: int) -> str:
    """Return a flame graph.

    Args:
        stacks: cycles by frames, outermost first.
        title: what it is of.
        hz: the core's frequency, for times.
    """
    root = _Box("all")
    for names, cycles in sorted(stacks.items()):
        if not cycles or names[-1:] == (ASLEEP,):
            continue
        box = root
        box.cycles += cycles
        for name in names:
            box = box.inner.setdefault(name, _Box(name))
            box.cycles += cycles
    asleep = sum(cycles for names, cycles in stacks.items() if names[-1:] == (ASLEEP,))
    depth = _depth(root)
    height = _TOP + depth * _ROW + _MARGIN
    awake_ms, share = root.cycles * 1e3 / hz, root.cycles / max(1, root.cycles + asleep)
    what = f"{root.cycles} cycles awake ({awake_ms:.3f} ms, {share:.2%} of the time)"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{height}" viewBox="0 0 {_WIDTH} {height}">',
        f"<style>{_STYLE}</style>",
        f'<rect width="{_WIDTH}" height="{height}" fill="#fdfcf8"/>',
        f'<text class="title" x="{_MARGIN}" y="24">{escape(title)}</text>',
        f'<text class="sub" x="{_MARGIN}" y="42">{escape(what)}; width: cycles, upwards: called from below</text>',
    ]
    if root.cycles:
        scale = (_WIDTH - 2 * _MARGIN) / root.cycles
        lines += _draw(root, _MARGIN, height - _MARGIN - _ROW, scale, root.cycles, hz)
    return "\n".join([*lines, "</svg>"]) + "\n"


def _depth(box: _Box) -> int:
    return 1 + max((_depth(inner) for inner in box.inner.values()), default=0)


def _draw(box: _Box, x: float, y: int, scale: float, total: int, hz: int) -> Iterator[str]:
    width = box.cycles * scale
    if width < _LEAST_PX:
        return
    share = box.cycles / total
    tip = f"{box.name}: {box.cycles} cycles, {box.cycles * 1e6 / hz:.1f} µs, {share:.2%}"
    room = int((width - 6) / _CHARACTER_PX)
    text = box.name if len(box.name) <= room else f"{box.name[: room - 1]}…"
    label = f'<text x="{x + 4:.2f}" y="{y + 14}">{escape(text)}</text>' if width >= _LEAST_TEXT_PX else ""
    yield (
        f'<g><title>{escape(tip)}</title><rect x="{x:.2f}" y="{y}" width="{max(width - 0.6, 0.3):.2f}" '
        f'height="{_ROW - 1}" fill="{_colour(box.name)}"/>{label}</g>'
    )
    for inner in sorted(box.inner.values(), key=lambda b: b.name):
        yield from _draw(inner, x, y - _ROW, scale, total, hz)
        x += inner.cycles * scale


def _colour(name: str) -> str:
    """Return a warm colour of the name's own; exceptions are blue, the bottom is grey."""
    if name == "all":
        return "#d9d5c9"
    mixed = zlib.crc32(name.encode())
    if name.startswith("<"):
        return f"hsl({205 + mixed % 20},60%,{70 + mixed // 32 % 8}%)"
    return f"hsl({18 + mixed % 32},{72 + mixed // 64 % 18}%,{64 + mixed // 4096 % 12}%)"
