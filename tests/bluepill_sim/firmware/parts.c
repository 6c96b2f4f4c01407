/* Drives one of every part, register by register, and prints over USART1 what it has found. */
#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(address))
#define RCC_(offset) REG(0x40021000u + (offset))
#define GPIOA_(offset) REG(0x40010800u + (offset))
#define GPIOB_(offset) REG(0x40010C00u + (offset))
#define USART1_(offset) REG(0x40013800u + (offset))
#define USART3_(offset) REG(0x40004800u + (offset))
#define I2C1_(offset) REG(0x40005400u + (offset))
#define SPI1_(offset) REG(0x40013000u + (offset))
#define TIM1_(offset) REG(0x40012C00u + (offset))
#define TIM2_(offset) REG(0x40000000u + (offset))
#define TIM4_(offset) REG(0x40000800u + (offset))
#define ADC1_(offset) REG(0x40012400u + (offset))
#define DMA1_(offset) REG(0x40020000u + (offset))
#define CAN_(offset) REG(0x40006400u + (offset))
#define NVIC_ICPR1 REG(0xE000E284u)
#define SCR REG(0xE000ED10u)
#define FLASH_ACR REG(0x40022000u)
#define HCLK_HZ 72000000u

int main(void);

static void put(char character)
{
    while (!(USART1_(0x00) & 1u << 7)) {
    }
    USART1_(0x04) = (uint8_t)character;
}

static void text(const char *words)
{
    while (*words) {
        put(*words++);
    }
}

static void number(int32_t value)
{
    char digits[12];
    unsigned at = sizeof digits;
    uint32_t left = value < 0 ? 0u - (uint32_t)value : (uint32_t)value;
    digits[--at] = '\0';
    do {
        digits[--at] = (char)('0' + left % 10u);
        left /= 10u;
    } while (left);
    if (value < 0) {
        digits[--at] = '-';
    }
    text(&digits[at]);
}

static void line(const char *name, int32_t value)
{
    text(name);
    put(' ');
    number(value);
    put('\n');
}

static void clocks(void)
{
    RCC_(0x00) |= 1u << 16;
    while (!(RCC_(0x00) & 1u << 17)) {
    }
    FLASH_ACR = 0x12;
    /* 8 MHz x 9; APB1 at 36 MHz, ADC at 12 MHz. */
    RCC_(0x04) = 1u << 16 | 7u << 18 | 4u << 8 | 2u << 14;
    RCC_(0x00) |= 1u << 24;
    while (!(RCC_(0x00) & 1u << 25)) {
    }
    RCC_(0x04) |= 2u;
    while ((RCC_(0x04) & 0xCu) != 8u) {
    }
    RCC_(0x14) |= 1u;                                              /* DMA1 */
    RCC_(0x18) |= 1u | 1u << 2 | 1u << 3 | 1u << 9 | 1u << 11 | 1u << 12 | 1u << 14;
    RCC_(0x1C) |= 1u | 1u << 2 | 1u << 18 | 1u << 21 | 1u << 25;    /* TIM2, TIM4, USART3, I2C1, CAN */
}

static void pins(void)
{
    /* PA0 servo, PA1 analog, PA4 select (high), PA5 SCK, PA6 MISO, PA7 MOSI. */
    GPIOA_(0x10) = 1u << 4;
    GPIOA_(0x00) = 0xB4B3440Bu;
    /* PA8 WS2812, PA9 TX, PA10 RX, PA11 CAN RX, PA12 CAN TX. */
    GPIOA_(0x04) = 0x444B44BBu;
    /* PB6 SCL and PB7 SDA open drain. */
    GPIOB_(0x00) = 0xFF444444u;
    /* PB8 trigger, PB9 echo, PB10 TX, PB11 RX, PB12 button, PB13 and PB14 LEDs. */
    GPIOB_(0x04) = 0x43344B43u;
}

/* A free timer in microseconds: TIM4. */
static void timer(void)
{
    TIM4_(0x28) = HCLK_HZ / 1000000u - 1u;
    TIM4_(0x2C) = 0xFFFF;
    TIM4_(0x14) = 1;
    TIM4_(0x00) = 1;
}

static void wait_us(uint16_t us)
{
    uint16_t begin = (uint16_t)TIM4_(0x24);
    while ((uint16_t)(TIM4_(0x24) - begin) < us) {
    }
}

/* I2C at 400 kHz. */
static void i2c_start(uint8_t address)
{
    I2C1_(0x00) |= 1u << 8 | 1u << 10;
    while (!(I2C1_(0x14) & 1u)) {
    }
    I2C1_(0x10) = address;
    while (!(I2C1_(0x14) & (1u << 1 | 1u << 10))) {
    }
    (void)I2C1_(0x18);
}

static void i2c_byte(uint8_t byte)
{
    I2C1_(0x10) = byte;
    while (!(I2C1_(0x14) & 1u << 2)) {
    }
}

static void i2c_stop(void)
{
    I2C1_(0x00) |= 1u << 9;
    while (I2C1_(0x00) & 1u << 9) {
    }
}

static void i2c_write(uint8_t address, uint8_t first, uint8_t second)
{
    i2c_start((uint8_t)(address << 1));
    i2c_byte(first);
    i2c_byte(second);
    i2c_stop();
}

static void i2c_read(uint8_t address, uint8_t at, uint8_t *into, unsigned count)
{
    i2c_start((uint8_t)(address << 1));
    i2c_byte(at);
    I2C1_(0x00) |= 1u << 8 | 1u << 10;
    while (!(I2C1_(0x14) & 1u)) {
    }
    I2C1_(0x10) = (uint8_t)(address << 1 | 1u);
    while (!(I2C1_(0x14) & 1u << 1)) {
    }
    if (count == 1) {
        I2C1_(0x00) &= ~(1u << 10);
    }
    (void)I2C1_(0x18);
    for (unsigned n = 0; n < count; n++) {
        if (n + 1 == count) {
            I2C1_(0x00) &= ~(1u << 10);
            I2C1_(0x00) |= 1u << 9;
        }
        while (!(I2C1_(0x14) & 1u << 6)) {
        }
        into[n] = (uint8_t)I2C1_(0x10);
    }
    while (I2C1_(0x00) & 1u << 9) {
    }
}

static void oled(void)
{
    static const uint8_t begin[] = {0xAE, 0x20, 0x00, 0xA1, 0xC8, 0x8D, 0x14, 0x21, 0, 127, 0x22, 0, 7, 0xAF};
    for (unsigned n = 0; n < sizeof begin; n++) {
        i2c_write(0x3C, 0x00, begin[n]);
    }
    i2c_start(0x3C << 1);
    i2c_byte(0x40);
    for (unsigned page = 0; page < 8; page++) {
        for (unsigned x = 0; x < 128; x++) {
            i2c_byte(x / 8 == page ? 0xFF : page == 0 ? 0x01 : x == 0 ? 0xFF : 0x00);
        }
    }
    i2c_stop();
    text("oled written\n");
}

static void imu(void)
{
    uint8_t bytes[14];
    i2c_read(0x68, 0x75, bytes, 1);
    line("imu is", bytes[0]);
    i2c_write(0x68, 0x6B, 0x01);
    i2c_write(0x68, 0x1A, 0x03);
    i2c_write(0x68, 0x19, 0x04);
    wait_us(12000);
    i2c_read(0x68, 0x3B, bytes, 14);
    line("imu x", (int16_t)(bytes[0] << 8 | bytes[1]));
    line("imu z", (int16_t)(bytes[4] << 8 | bytes[5]));
    line("imu turns", (int16_t)(bytes[12] << 8 | bytes[13]));
}

static void eeprom(void)
{
    uint8_t byte;
    i2c_start(0x50 << 1);
    i2c_byte(3);
    i2c_byte(0x5A);
    i2c_stop();
    wait_us(6000);
    i2c_read(0x50, 3, &byte, 1);
    line("eeprom has", byte);
}

static uint8_t spi(uint8_t byte)
{
    SPI1_(0x0C) = byte;
    while (!(SPI1_(0x08) & 1u)) {
    }
    return (uint8_t)SPI1_(0x0C);
}

static uint8_t sd(uint8_t command, uint32_t argument, uint8_t crc)
{
    uint8_t answer = 0xFF;
    spi(0xFF);
    spi((uint8_t)(0x40u | command));
    for (int shift = 24; shift >= 0; shift -= 8) {
        spi((uint8_t)(argument >> shift));
    }
    spi(crc);
    for (unsigned n = 0; n < 10 && (answer & 0x80u); n++) {
        answer = spi(0xFF);
    }
    return answer;
}

static void card(void)
{
    SPI1_(0x00) = 1u << 2 | 1u << 9 | 1u << 8 | 1u << 6 | 1u << 3;
    for (unsigned n = 0; n < 10; n++) {
        spi(0xFF);
    }
    GPIOA_(0x14) = 1u << 4;
    line("card idle", sd(0, 0, 0x95));
    line("card knows 8", sd(8, 0x1AA, 0x87));
    spi(0xFF), spi(0xFF), spi(0xFF);
    line("card echoes", spi(0xFF));
    unsigned tries = 0;
    do {
        sd(55, 0, 1);
        tries++;
    } while (sd(41, 0x40000000, 1) && tries < 1000);
    line("card waits", tries > 1);
    sd(58, 0, 1);
    line("card ocr", spi(0xFF));
    line("card takes", sd(24, 5, 1));
    spi(0xFE);
    for (unsigned n = 0; n < 514; n++) {
        spi((uint8_t)n);
    }
    line("card took", spi(0xFF) & 0x1F);
    while (spi(0xFF) != 0xFF) {
    }
    line("card gives", sd(17, 5, 1));
    while (spi(0xFF) != 0xFE) {
    }
    uint32_t sum = 0;
    for (unsigned n = 0; n < 512; n++) {
        sum += spi(0xFF);
    }
    spi(0xFF), spi(0xFF);
    GPIOA_(0x10) = 1u << 4;
    line("card sum", (int32_t)sum);
}

static void ultrasonic(void)
{
    GPIOB_(0x10) = 1u << 8;
    wait_us(12);
    GPIOB_(0x14) = 1u << 8;
    while (!(GPIOB_(0x08) & 1u << 9)) {
    }
    uint16_t begin = (uint16_t)TIM4_(0x24);
    while (GPIOB_(0x08) & 1u << 9) {
    }
    line("echo us", (uint16_t)(TIM4_(0x24) - begin));
}

static void servo(void)
{
    TIM2_(0x28) = HCLK_HZ / 1000000u - 1u;
    TIM2_(0x2C) = 20000 - 1;
    TIM2_(0x34) = 1750;
    TIM2_(0x18) = 6u << 4 | 1u << 3;
    TIM2_(0x20) = 1;
    TIM2_(0x14) = 1;
    TIM2_(0x00) = 1;
}

/* Three LEDs of 24 bits, and 50 us and more of nothing. */
#define BITS (3u * 24u)
static uint16_t duties[BITS + 60u];

static void strip(void)
{
    static const uint32_t colours[3] = {0x10FF20u, 0x0000FFu, 0xFFFFFFu}; /* green, red, blue */
    for (unsigned n = 0; n < BITS; n++) {
        duties[n] = colours[n / 24] >> (23 - n % 24) & 1u ? 58 : 29;
    }
    TIM1_(0x2C) = 90 - 1; /* 1.25 us */
    TIM1_(0x34) = 0;
    TIM1_(0x18) = 6u << 4 | 1u << 3;
    TIM1_(0x20) = 1;
    TIM1_(0x44) = 1u << 15;
    TIM1_(0x14) = 1;
    TIM1_(0x0C) = 1u << 8; /* UDE: channel 5 */
    DMA1_(0x08 + 20 * 4) = 0;
    DMA1_(0x0C + 20 * 4) = sizeof duties / sizeof duties[0];
    DMA1_(0x10 + 20 * 4) = 0x40012C34u;
    DMA1_(0x14 + 20 * 4) = (uint32_t)duties;
    DMA1_(0x08 + 20 * 4) = 1u << 10 | 1u << 8 | 1u << 7 | 1u << 4 | 1u;
    TIM1_(0x00) = 1;
    while (!(DMA1_(0x00) & 1u << 17)) {
    }
    text("strip sent\n");
}

static void adc(void)
{
    ADC1_(0x08) = 1;
    wait_us(2);
    ADC1_(0x34) = 1;
    ADC1_(0x08) = 1;
    while (!(ADC1_(0x00) & 1u << 1)) {
    }
    line("volts", (int32_t)ADC1_(0x4C));
}

static void can(void)
{
    CAN_(0x00) = 1;
    while (!(CAN_(0x04) & 1u)) {
    }
    CAN_(0x1C) = 3u | 12u << 16 | 3u << 20; /* 36 MHz / 4 / 18: 500 kbit/s */
    CAN_(0x200) = 1;
    CAN_(0x20C) = 1;
    CAN_(0x240) = 0;
    CAN_(0x244) = 0;
    CAN_(0x21C) = 1;
    CAN_(0x200) = 0;
    CAN_(0x00) = 0;
    while (CAN_(0x04) & 1u) {
    }
    CAN_(0x184) = 2;
    CAN_(0x188) = 0x0000BEEFu;
    CAN_(0x180) = 0x321u << 21 | 1u;
    for (unsigned frames = 0; frames < 2; frames++) {
        while (!(CAN_(0x0C) & 3u)) {
        }
        line("can id", (int32_t)(CAN_(0x1B0) >> 21));
        line("can data", (int32_t)CAN_(0x1B8));
        CAN_(0x0C) = 1u << 5;
    }
}

static void button(void)
{
    unsigned changes = 0, before = 1;
    uint16_t last = (uint16_t)TIM4_(0x24);
    GPIOB_(0x10) = 1u << 13;
    while ((uint16_t)(TIM4_(0x24) - last) < 15000u || !changes) {
        unsigned now = GPIOB_(0x08) >> 12 & 1u;
        if (now != before) {
            changes++;
            before = now;
            last = (uint16_t)TIM4_(0x24);
            GPIOB_(0x10) = now ? 1u << 30 : 1u << 14;
        }
    }
    line("button changed", changes > 2);
    line("button is", (int32_t)before);
}

static void position(void)
{
    USART3_(0x08) = HCLK_HZ / 2u / 9600u;
    USART3_(0x0C) = 1u << 13 | 1u << 5 | 1u << 2;
    SCR = 1u << 4; /* SEVONPEND: a pending interrupt ends WFE, though it is not enabled */
    unsigned lines = 0;
    uint8_t at_begin = 0, byte;
    while (lines < 3) {
        while (!(USART3_(0x00) & 1u << 5)) {
            __asm volatile("wfe");
            NVIC_ICPR1 = 1u << (39 - 32);
        }
        byte = (uint8_t)USART3_(0x04);
        at_begin |= byte == '$';
        if (at_begin) {
            put((char)byte);
            lines += byte == '\n';
        }
    }
}

int main(void)
{
    clocks();
    pins();
    USART1_(0x08) = HCLK_HZ / 921600u;
    USART1_(0x0C) = 1u << 13 | 1u << 3;
    timer();
    I2C1_(0x04) = 36;
    I2C1_(0x1C) = 1u << 15 | 30u;
    I2C1_(0x20) = 11;
    I2C1_(0x00) = 1;
    servo();
    oled();
    imu();
    eeprom();
    card();
    ultrasonic();
    strip();
    adc();
    can();
    button();
    position();
    text("done\n");
    for (;;) {
        __asm volatile("wfi");
    }
}
