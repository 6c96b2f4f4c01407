"""The picture of docs/silicon.md: a BluePill and the eight channels of a logic analyser at its pins.

Not to scale; pins in the order in which they stand on the board, USB above.
"""

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

#: Pins of the board's two edges from the USB end; a clone may have others, and what is printed beside a pin counts.
LEFT = ("B12", "B13", "B14", "B15", "A8", "A9", "A10", "A11", "A12", "A15", "B3", "B4", "B5", "B6", "B7", "B8", "B9",
        "5V", "G", "3.3")  # fmt: skip
RIGHT = ("G", "G ", "3.3", "R", "B11", "B10", "B1", "B0", "A7", "A6", "A5", "A4", "A3", "A2", "A1", "A0", "C15", "C14",
         "C13", "VB")  # fmt: skip
#: What is at a pin, by the side and the pin.
CHANNELS = {
    "A0": "D0  asks for the interrupt", "A1": "D1  the handler", "A2": "D2  the store behind", "A3": "D3  instructions",
    "A4": "D4  before the character", "A5": "D5  a conversion", "A9": "D6  the character", "B0": "D7  a round",
}  # fmt: skip
COLOURS = ("#1d2327", "#8a5a2b", "#b00020", "#d9822b", "#c9a800", "#2f7d32", "#1b6ca8", "#6a3d9a")
GROUND = "GND of the analyser"


def draw(target: Path) -> None:
    """Draw into a PNG file."""
    figure = Figure(figsize=(7.6, 4.6), facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-6.2, 8.2), ylim=(-1.0, 16.6))
    axes.set_axis_off()
    axes.add_patch(Rectangle((0, 0), 3.2, 15.4, facecolor="#2b5f9e", edgecolor="#173a63"))
    axes.add_patch(Rectangle((1.1, 14.6), 1.0, 1.4, facecolor="#b8bec4", edgecolor="#5c6670"))
    axes.add_patch(Rectangle((1.05, 6.3), 1.1, 2.2, facecolor="#20262b"))
    axes.text(1.6, 7.4, "F103", color="white", ha="center", va="center", fontsize=8)
    axes.text(1.6, 16.2, "USB: power", ha="center", va="bottom", fontsize=8)
    axes.text(1.6, -0.3, "SWD: only to flash", ha="center", va="top", fontsize=8)
    for names, side in ((LEFT, -1), (RIGHT, 1)):
        for place, name in enumerate(names):
            _pin(axes, name, 14.4 - 0.73 * place, side)
    figure.savefig(target, dpi=100, metadata={"Software": None})


def _pin(axes: object, name: str, y: float, side: int) -> None:
    x = 3.0 if side > 0 else 0.2
    axes.plot(x, y, "o", color="#e3c565", markersize=6)  # type: ignore[attr-defined]
    axes.text(x - 0.25 * side, y, name, color="white", fontsize=7, va="center",  # type: ignore[attr-defined]
              ha="right" if side > 0 else "left")  # fmt: skip
    said = CHANNELS.get(name) or (GROUND if name == "G" and side > 0 else None)
    if said is None:
        return
    colour = COLOURS[int(said[1])] if name in CHANNELS else "#1d2327"
    end = x + 1.6 * side
    axes.plot([x, end], [y, y], color=colour, linewidth=2)  # type: ignore[attr-defined]
    axes.text(end + 0.15 * side, y, said, color=colour, fontsize=9, va="center",  # type: ignore[attr-defined]
              ha="left" if side > 0 else "right")  # fmt: skip
