"""What the tests of the USART share: bits, a rate, and a set-up."""

from typing import Any

ORE, IDLE, RXNE, TC, TXE = 8, 16, 32, 64, 128
SBK, RE, TE, IDLEIE, RXNEIE, TCIE, TXEIE, PS, PCE, M, UE = (1 << n for n in (0, 2, 3, 4, 5, 6, 7, 9, 10, 12, 13))
IRQ = 37
#: 8 MHz / 69 = 115942 baud; ten bits take 10 * 69 / 8 MHz = 86250 ns exactly.
BRR, CHARACTER_NS = 69, 86_250


def set_up(chip: Any, control: int = 0, stop: int = 0) -> list[tuple[int, int]]:
    """PA9 as alternate output, USART1 on; returns what comes out. Ends when the idle character of TE has gone."""
    sent: list[tuple[int, int]] = []
    chip.parts.usart(1).sinks.append(sent.extend)
    chip.write("GPIOA.CRH", 0x4444_44B4)
    chip.write("USART1.BRR", BRR)
    chip.write("USART1.CR2", stop << 12)
    chip.write("USART1.CR1", UE | TE | RE | control)
    chip.advance(chip.now_ns + 20 * CHARACTER_NS // 10)
    return sent


def status(chip: Any) -> int:
    return chip.parts.usart(1).words[0]
