"""NVIC: which exceptions are pending, enabled and active, which comes first, and what they are called.

This holds the state and the arithmetic of priorities. Stacking, vectors and
the masks PRIMASK, BASEPRI and FAULTMASK are the business of `processor.py`; the registers
through which firmware sees all this are in `system_control.py`.

Source: ARMv7-M Architecture Reference Manual B1.5.4, table B1-4 and B3.4; RM0008 table 63 (medium density).
Invariant: an exception is pending at most once; a line that stays high makes
its interrupt pending again when its handler returns.
"""

import ctypes
from collections.abc import Iterator
from typing import Any

from bluepill_sim.extension.layout import SHARED, structure
from bluepill_sim.extension.windows import field, wide
from simbase.state import Stateful

NMI, HARD_FAULT, MEM_MANAGE, BUS_FAULT, USAGE_FAULT = 2, 3, 4, 5, 6
SVCALL, DEBUG_MONITOR, PENDSV, SYSTICK = 11, 12, 14, 15
#: Exception number of interrupt line 0.
FIRST_IRQ = 16

_SYSTEM_NAMES = {
    1: "Reset",
    2: "NMI",
    3: "HardFault",
    4: "MemManage",
    5: "BusFault",
    6: "UsageFault",
    11: "SVCall",
    12: "DebugMonitor",
    14: "PendSV",
    15: "SysTick",
}

#: By interrupt line: line n is exception 16 + n.
IRQ_NAMES = (
    "WWDG", "PVD", "TAMPER", "RTC", "FLASH", "RCC", "EXTI0", "EXTI1", "EXTI2", "EXTI3", "EXTI4",
    "DMA1_Channel1", "DMA1_Channel2", "DMA1_Channel3", "DMA1_Channel4", "DMA1_Channel5", "DMA1_Channel6",
    "DMA1_Channel7", "ADC1_2", "USB_HP_CAN_TX", "USB_LP_CAN_RX0", "CAN_RX1", "CAN_SCE", "EXTI9_5", "TIM1_BRK",
    "TIM1_UP", "TIM1_TRG_COM", "TIM1_CC", "TIM2", "TIM3", "TIM4", "I2C1_EV", "I2C1_ER", "I2C2_EV", "I2C2_ER",
    "SPI1", "SPI2", "USART1", "USART2", "USART3", "EXTI15_10", "RTCAlarm", "USBWakeUp",
)  # fmt: skip

#: Entries of the vector table, the stack pointer at 0 included.
VECTOR_COUNT = FIRST_IRQ + len(IRQ_NAMES)

#: Priority of thread mode: lower than that of every exception.
THREAD_PRIORITY = 256
#: Priorities that cannot be set.
FIXED_PRIORITIES = {NMI: -2, HARD_FAULT: -1}

SYSTEM_EXCEPTIONS = (1 << FIRST_IRQ) - 1


class Nvic(Stateful):
    """State of all exceptions; numbers are those of the architecture (IRQ line n is 16 + n)."""

    STATE = ("pending", "active", "held", "enabled", "levels", "priorities", "priority_grouping")

    pending: int = wide("pending", "A bit mask over exception numbers.")
    active: int = wide("active", "A bit mask over exception numbers.")
    held: int = wide("held", "Pending exceptions whose time has not come: their latency is varied.")
    enabled: int = field("enabled", "A bit mask over interrupt lines.")
    levels: int = field("levels", "A bit mask over interrupt lines.")
    priority_grouping: int = field("grouping", "AIRCR.PRIGROUP.")

    def __init__(self, shared: Any = None) -> None:
        """Make it in the state after a reset.

        Args:
            shared: the struct that holds the state; None: one of its own.
        """
        self.shared = structure(SHARED)() if shared is None else shared
        #: A byte an exception.
        self.priorities = self.shared.priorities

    def reset(self) -> None:
        """Go back to the state after a reset; the levels of the lines belong to the peripherals."""
        self.pending = self.active = self.held = self.enabled = 0
        ctypes.memset(self.priorities, 0, len(self.priorities))
        self.priority_grouping = 0

    # Interrupt lines.

    def set_level(self, irq: int, level: bool) -> None:
        """Set a line; its rising edge makes the interrupt pending."""
        bit = 1 << irq
        if level:
            if not self.levels & bit:
                self.levels |= bit
                self.pending |= bit << FIRST_IRQ
        else:
            self.levels &= ~bit

    def pend(self, number: int) -> None:
        """Make an exception pending."""
        self.pending |= 1 << number

    def activate(self, number: int) -> None:
        """Note that the handler of an exception starts."""
        self.pending &= ~(1 << number)
        self.active |= 1 << number

    def deactivate(self, number: int) -> None:
        """Note that the handler of an exception has returned."""
        self.active &= ~(1 << number)
        if number >= FIRST_IRQ and self.levels >> (number - FIRST_IRQ) & 1:
            self.pending |= 1 << number

    # Priorities.

    def deliverable(self) -> int:
        """Return the pending exceptions that are enabled, as a mask over exception numbers."""
        pending = self.pending & ~self.held
        return pending and pending & (self.enabled << FIRST_IRQ | SYSTEM_EXCEPTIONS)

    def first_pending(self) -> int | None:
        """Return the enabled pending exception of the highest priority; the lowest number among equals."""
        candidates = self.deliverable()
        if not candidates:
            return None
        if not candidates & candidates - 1:
            return candidates.bit_length() - 1
        return min(numbers_of(candidates), key=lambda number: (self.priority(number), number))

    def priority(self, number: int) -> int:
        """Return the priority of an exception; lower comes first."""
        fixed = FIXED_PRIORITIES.get(number)
        return self.priorities[number] if fixed is None else fixed

    def group_priority(self, priority: int) -> int:
        """Return the part of a priority that decides on preemption (AIRCR.PRIGROUP)."""
        if priority < 0 or priority >= THREAD_PRIORITY:
            return priority
        return priority & ~((2 << self.priority_grouping) - 1)

    def active_priority(self) -> int:
        """Return the group priority of the handlers that are active, masks left aside."""
        if not self.active:
            return THREAD_PRIORITY
        return min(self.group_priority(self.priority(number)) for number in numbers_of(self.active))

    def can_preempt(self, number: int, execution_priority: int) -> bool:
        """Tell whether an exception may interrupt what runs at `execution_priority`."""
        return self.group_priority(self.priority(number)) < execution_priority


def exception_name(number: int) -> str:
    """Return the name of an exception, such as "SysTick" or "USART1"; "thread" for 0."""
    if not number:
        return "thread"
    if FIRST_IRQ <= number < VECTOR_COUNT:
        return IRQ_NAMES[number - FIRST_IRQ]
    return _SYSTEM_NAMES.get(number, f"exception {number}")


def numbers_of(mask: int) -> Iterator[int]:
    """Iterate over the positions of the bits of a mask, lowest first."""
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
