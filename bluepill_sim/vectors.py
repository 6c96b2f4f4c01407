"""Names of the exceptions and interrupts of an STM32F103C8.

Source: ARMv7-M Architecture Reference Manual table B1-4; RM0008 table 63 (medium density).
Invariant: position n of `IRQ_NAMES` is interrupt line n, which is exception 16 + n.
"""

from bluepill_sim.nvic import FIRST_IRQ

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

IRQ_NAMES = (
    "WWDG", "PVD", "TAMPER", "RTC", "FLASH", "RCC", "EXTI0", "EXTI1", "EXTI2", "EXTI3", "EXTI4",
    "DMA1_Channel1", "DMA1_Channel2", "DMA1_Channel3", "DMA1_Channel4", "DMA1_Channel5", "DMA1_Channel6",
    "DMA1_Channel7", "ADC1_2", "USB_HP_CAN_TX", "USB_LP_CAN_RX0", "CAN_RX1", "CAN_SCE", "EXTI9_5", "TIM1_BRK",
    "TIM1_UP", "TIM1_TRG_COM", "TIM1_CC", "TIM2", "TIM3", "TIM4", "I2C1_EV", "I2C1_ER", "I2C2_EV", "I2C2_ER",
    "SPI1", "SPI2", "USART1", "USART2", "USART3", "EXTI15_10", "RTCAlarm", "USBWakeUp",
)  # fmt: skip

#: Entries of the vector table, the stack pointer at 0 included.
VECTOR_COUNT = FIRST_IRQ + len(IRQ_NAMES)


def exception_name(number: int) -> str:
    """Return the name of an exception, such as "SysTick" or "USART1"; "thread" for 0."""
    if not number:
        return "thread"
    if FIRST_IRQ <= number < VECTOR_COUNT:
        return IRQ_NAMES[number - FIRST_IRQ]
    return _SYSTEM_NAMES.get(number, f"exception {number}")
