"""The picture of docs/parts.md: what parts show and do while the program of their tests drives them.

Not a test: those stand in tests/bluepill_sim/board/parts.
"""

from pathlib import Path

import matplotlib as mpl
from matplotlib import pyplot as plt

from bluepill_sim import BluePill
from bluepill_sim.fabric.subscriptions import EDGE, HIGH, Of
from bluepill_sim.parts.registry import attach, parse_part

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "tests" / "bluepill_sim" / "firmware" / "parts.elf"
PARTS = (
    "ssd1306,on=I2C1", "mpu6050,on=I2C1", "24c02,on=I2C1", "sd-card,on=SPI1,select=PA4",
    "hc-sr04,trig=PB8,echo=PB9,distance_m=0.5", "servo,signal=PA0", "ws2812,din=PA8,leds=3",
    "potentiometer,wiper=PA1,position=0.25", "can-node,on=CAN,period_ms=60",
    "button,out=PB12,presses_s=0.07,held_s=0.01", "leds,led0=PB13,led1=PB14", "gps,on=USART3,rate_hz=5,fix_s=0.3",
)  # fmt: skip
#: Title, pins, and from when to when in ms.
WIRES = (
    ("hc-sr04: trig and echo, 0.5 m", ("PB8", "PB9"), (51.0, 55.5)),
    ("servo: signal, 1.75 ms", ("PA0",), (18.0, 64.0)),
    ("ws2812: din, nine of its bits", ("PA8",), (54.835, 54.8465)),
    ("button: out bounces, 3 ms", ("PB12",), (69.0, 84.5)),
)


def draw(target: Path) -> None:
    """Run the program, and draw into a PNG file."""
    mpl.use("Agg")
    board = BluePill(PROGRAM)
    for words in PARTS:
        attach(board, parse_part(words))
    edges: dict[str, list[tuple[float, bool]]] = {
        name: [(0.0, board.pin(name).level)] for _, names, _ in WIRES for name in names
    }
    name_of = {board.pin(name).index: name for name in edges}

    def take(rows: bytes) -> None:
        for ns, pin, _, wire, _, _ in EDGE.iter_unpack(rows):
            edges[name_of[pin]].append((ns / 1e6, wire == HIGH))

    board.subscribe_pins(edges, take, of=Of.WIRE)
    board.run_for("450 ms")
    figure, axes = plt.subplots(3, 2, figsize=(9, 6.2), layout="constrained", facecolor="#e8e8e8")
    for axis, name in zip(axes[0], ("ssd1306", "ws2812"), strict=True):
        part = board.attached.by_name[name]
        axis.imshow(part.picture().rows, interpolation="nearest")
        axis.set_title(f"{name}: {part.words()}", fontsize=8)
        axis.set_axis_off()
    for axis, (title, names, (begin, end)) in zip(axes[1:].flat, WIRES, strict=True):
        for row, name in enumerate(reversed(names)):
            times = [at for at, _ in edges[name]] + [450.0]
            levels = [1.5 * row + level for _, level in edges[name]]
            axis.step(times, [*levels, levels[-1]], where="post", linewidth=1)
        axis.set(xlim=(begin, end), ylim=(-0.3, 1.5 * len(names)), yticks=[], xlabel="ms")
        axis.set_title(title, fontsize=9)
    figure.savefig(target, dpi=100, metadata={"Software": None})
    plt.close(figure)
