/* bluepill_sim/extension/source/registers/afio.h: RM0008 9.4; made from peripherals/afio.py. */
#ifndef BLUEPILL_REGISTERS_AFIO_H
#define BLUEPILL_REGISTERS_AFIO_H

/* Registers by offset / 4. */
enum { EVCR = 0, MAPR = 1, EXTICR1 = 2, EXTICR2 = 3, EXTICR3 = 4, EXTICR4 = 5 };

/* Of EVCR. */
enum { EVOE = 1 << 7, PORT = 0x7 << 4, PORT_AT = 4, PIN = 0xf << 0, PIN_AT = 0 };

/* Of MAPR. */
enum { SWJ_CFG = 0x7 << 24, SWJ_CFG_AT = 24, ADC2_ETRGREG = 1 << 20, ADC2_ETRGINJ = 1 << 19, ADC1_ETRGREG = 1 << 18,
       ADC1_ETRGINJ = 1 << 17, TIM5CH4_IREMAP = 1 << 16, PD01_REMAP = 1 << 15, CAN = 0x3 << 13, CAN_AT = 13,
       TIM4 = 1 << 12, TIM3 = 0x3 << 10, TIM3_AT = 10, TIM2 = 0x3 << 8, TIM2_AT = 8, TIM1 = 0x3 << 6, TIM1_AT = 6,
       USART3 = 0x3 << 4, USART3_AT = 4, USART2 = 1 << 3, USART1 = 1 << 2, I2C1 = 1 << 1, SPI1 = 1 << 0 };

/* Of EXTICR1. */
enum { EXTI3 = 0xf << 12, EXTI3_AT = 12, EXTI2 = 0xf << 8, EXTI2_AT = 8, EXTI1 = 0xf << 4, EXTI1_AT = 4,
       EXTI0 = 0xf << 0, EXTI0_AT = 0 };

/* Of EXTICR2. */
enum { EXTI7 = 0xf << 12, EXTI7_AT = 12, EXTI6 = 0xf << 8, EXTI6_AT = 8, EXTI5 = 0xf << 4, EXTI5_AT = 4,
       EXTI4 = 0xf << 0, EXTI4_AT = 0 };

/* Of EXTICR3. */
enum { EXTI11 = 0xf << 12, EXTI11_AT = 12, EXTI10 = 0xf << 8, EXTI10_AT = 8, EXTI9 = 0xf << 4, EXTI9_AT = 4,
       EXTI8 = 0xf << 0, EXTI8_AT = 0 };

/* Of EXTICR4. */
enum { EXTI15 = 0xf << 12, EXTI15_AT = 12, EXTI14 = 0xf << 8, EXTI14_AT = 8, EXTI13 = 0xf << 4, EXTI13_AT = 4,
       EXTI12 = 0xf << 0, EXTI12_AT = 0 };

/* What Python is notified of. */
enum { PLACED = 2, ROUTED = 3, MEANINGLESS = 4 };

#endif
