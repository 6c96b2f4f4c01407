"""A talk with a firmware over one of its serial ports, in virtual time: what is said, and what must come back."""

import re
from dataclasses import dataclass

from bluepill_sim import BluePill
from bluepill_sim.cli.parts import attach_parts
from bluepill_sim.parts.serial_port import BoardSerialLine
from bluepill_sim.spans import Span, to_nanos
from simbase.timing import NS_PER_MS
from tools.foreign.row import RowError, RowPlace

#: chosen: what has come is looked at so often, and so much of it is shown.
_SLICE_NS = 5 * NS_PER_MS
_SHOWN_CHARACTERS = 60


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """One exchange.

    Args:
        hear: A regular expression that what comes after it was said must match; its first group, or all of it, is
            reported as what came back.
        say: What is sent first; empty: nothing.
        within: How long that may take, in virtual time.
        pause: How long it is waited before anything is sent.
    """

    hear: bytes
    say: bytes = b""
    within: Span = "2 s"
    pause: Span = 0


@dataclass(frozen=True, kw_only=True)
class Dialogue:
    """Boots an image and talks to it.

    Args:
        image: The firmware, a file of the cache.
        steps: What is said, one after the other.
        port: "usart1" to "usart3", or "usb" for the serial port of a USB device.
        baud: The speed of the far end; None follows the program.
        attach: Parts, as `p2os mcu run --attach` has them.
        drive: Levels of pins by name, before it begins.
        volts: Volts of pins by name.
    """

    image: str
    steps: tuple[Exchange, ...]
    port: str = "usart1"
    baud: int | None = None
    attach: tuple[str, ...] = ()
    drive: tuple[tuple[str, int], ...] = ()
    volts: tuple[tuple[str, float], ...] = ()

    @property
    def needs(self) -> tuple[str, ...]:
        """The image."""
        return (self.image,)

    def run(self, place: RowPlace) -> str:
        """Return what was heard, step by step."""
        board = BluePill(place.path(self.image))
        attach_parts(board, [place.filled(text) for text in self.attach])
        for pin, level in self.drive:
            board.pin(pin).drive(level)
        for pin, volts in self.volts:
            board.pin(pin).set_volts(volts)
        port: BoardSerialLine
        if self.port == "usb":
            port = board.usb_serial
            board.usb.wait_configured("5 s")
        else:
            port = board.serial_ports[self.port]
            board.serial_ports[self.port].far_baud = self.baud
        heard = bytearray()
        port.subscribe(lambda rows: heard.extend(word & 0xFF for word, _ in rows))
        answers = []
        for step in self.steps:
            if step.pause:
                board.run_for(step.pause)
            if step.say:
                heard.clear()
                port.receive(step.say)
            answers.append(_heard(board, heard, step))
        return "; ".join(answers)


def _heard(board: BluePill, heard: bytearray, step: Exchange) -> str:
    """Run until a step's words have come; return them, and forget what came up to their end."""
    end_ns = board.now_ns + to_nanos(step.within)
    while True:
        found = re.search(step.hear, heard, re.DOTALL)
        if found is not None:
            words = (found[1] if found.re.groups else found[0]).decode(errors="replace")
            del heard[: found.end()]
            return " ".join(words.split())[:_SHOWN_CHARACTERS]
        if board.now_ns >= end_ns or board.has_died:
            said = f" to {step.say!r}" if step.say else ""
            raise RowError(
                f"no {step.hear!r}{said} within {step.within}; it said {bytes(heard[-_SHOWN_CHARACTERS:])!r}; "
                f"{board.verdict or 'at ' + board.where()}"
            )
        board.run_for(_SLICE_NS)
