/* bluepill_sim/extension/source/registers/rcc.h: RM0008 7.3; made from peripherals/rcc.py. */
#ifndef BLUEPILL_REGISTERS_RCC_H
#define BLUEPILL_REGISTERS_RCC_H

/* Registers by offset / 4. */
enum { CR = 0, CFGR = 1, CIR = 2, APB2RSTR = 3, APB1RSTR = 4, AHBENR = 5, APB2ENR = 6, APB1ENR = 7, BDCR = 8,
       CSR = 9 };

/* Of CR. */
enum { PLLRDY = 1 << 25, PLLON = 1 << 24, CSSON = 1 << 19, HSEBYP = 1 << 18, HSERDY = 1 << 17, HSEON = 1 << 16,
       HSICAL = 0xff << 8, HSICAL_AT = 8, HSITRIM = 0x1f << 3, HSITRIM_AT = 3, HSIRDY = 1 << 1, HSION = 1 << 0 };

/* Of CFGR. */
enum { MCO = 0x7 << 24, MCO_AT = 24, USBPRE = 1 << 22, PLLMUL = 0xf << 18, PLLMUL_AT = 18, PLLXTPRE = 1 << 17,
       PLLSRC = 1 << 16, ADCPRE = 0x3 << 14, ADCPRE_AT = 14, PPRE2 = 0x7 << 11, PPRE2_AT = 11, PPRE1 = 0x7 << 8,
       PPRE1_AT = 8, HPRE = 0xf << 4, HPRE_AT = 4, SWS = 0x3 << 2, SWS_AT = 2, SW = 0x3 << 0, SW_AT = 0 };

/* Of CIR. */
enum { CSSC = 1 << 23, PLLRDYC = 1 << 20, HSERDYC = 1 << 19, HSIRDYC = 1 << 18, LSERDYC = 1 << 17, LSIRDYC = 1 << 16,
       PLLRDYIE = 1 << 12, HSERDYIE = 1 << 11, HSIRDYIE = 1 << 10, LSERDYIE = 1 << 9, LSIRDYIE = 1 << 8,
       CSSF = 1 << 7, PLLRDYF = 1 << 4, HSERDYF = 1 << 3, HSIRDYF = 1 << 2, LSERDYF = 1 << 1, LSIRDYF = 1 << 0 };

/* Of APB2RSTR. */
enum { USART1 = 1 << 14, SPI1 = 1 << 12, TIM1 = 1 << 11, ADC2 = 1 << 10, ADC1 = 1 << 9, IOPE = 1 << 6, IOPD = 1 << 5,
       IOPC = 1 << 4, IOPB = 1 << 3, IOPA = 1 << 2, AFIO = 1 << 0 };

/* Of APB1RSTR. */
enum { PWR = 1 << 28, BKP = 1 << 27, CAN = 1 << 25, USB = 1 << 23, I2C2 = 1 << 22, I2C1 = 1 << 21, USART3 = 1 << 18,
       USART2 = 1 << 17, SPI2 = 1 << 14, WWDG = 1 << 11, TIM4 = 1 << 2, TIM3 = 1 << 1, TIM2 = 1 << 0 };

/* Of AHBENR. */
enum { CRC = 1 << 6, FLITF = 1 << 4, SRAM = 1 << 2, DMA1 = 1 << 0 };

/* Of BDCR. */
enum { BDRST = 1 << 16, RTCEN = 1 << 15, RTCSEL = 0x3 << 8, RTCSEL_AT = 8, LSEBYP = 1 << 2, LSERDY = 1 << 1,
       LSEON = 1 << 0 };

/* Of CSR. */
#define LPWRRSTF 0x80000000u
enum { WWDGRSTF = 1 << 30, IWDGRSTF = 1 << 29, SFTRSTF = 1 << 28, PORRSTF = 1 << 27, PINRSTF = 1 << 26,
       RMVF = 1 << 24, LSIRDY = 1 << 1, LSION = 1 << 0 };

/* Its outputs. */
enum { IRQ = 0, CSS = 1 };

/* What Python is told beside what a listener hears. */
enum { RESETS = 2, GATES = 3, CLOCKS = 4, SHOWS = 5, CSS_CLEARED = 6, IN_USE = 7, PLL_IS_ON = 8, NO_SOURCE = 9 };

/* What C does for Python. */
enum { SETTLE_CLOCKS = 16, WAIT = 17 };

/* How long each oscillator takes to start, in ns. */
enum { HSI_START_NS = 2000, HSE_START_NS = 2000000, PLL_START_NS = 200000, LSE_START_NS = 1500000000,
       LSI_START_NS = 85000 };

/* Frequencies in Hz. */
enum { HSI_HZ = 8000000, LSE_HZ = 32768, TRIM_STEP_HZ = 40000 };

#endif
