/* analog: says ten times a second what the ADC has seen; DMA moves samples and text.
 *
 * ADC1 scans five pins (a battery on PA0, four sensors on PA4 to PA7), the chip's temperature and its reference
 * without a pause, and channel 1 of DMA1 keeps the latest of each in `samples`. A line of text goes out over USART1
 * by channel 4. No interrupt but the tick's. The supply follows from the reference, which is 1.20 V.
 */
#include "board.h"
#include "f103_analog.h"
#include "tick.h"

#define PIN_COUNT 5u
#define COUNT (PIN_COUNT + 2u)
#define REFERENCE_MV 1200u
#define STEPS 4096u
/* V25 and slope of the sensor, DS5319 table 50: 1.43 V, 4.3 mV/degC. */
#define V25_UV 1430000
#define SLOPE_UV 4300

static volatile uint16_t samples[COUNT];
static const uint8_t channels[COUNT] = {0, 4, 5, 6, 7, ADC_CHANNEL_TEMPERATURE, ADC_CHANNEL_VREFINT};
static char text[160];
static uint32_t length;

static void put(const char *more)
{
    while (*more != '\0' && length < sizeof text) {
        text[length++] = *more++;
    }
}

static void put_number(int32_t number)
{
    char digits[12];
    uint32_t at = sizeof digits;
    uint32_t magnitude = number < 0 ? 0u - (uint32_t)number : (uint32_t)number;
    digits[--at] = '\0';
    do {
        digits[--at] = (char)('0' + magnitude % 10u);
        magnitude /= 10u;
    } while (magnitude != 0);
    put(number < 0 ? "-" : "");
    put(&digits[at]);
}

static void dma_start(uint32_t number, volatile uint32_t *data, volatile void *memory, uint32_t count, uint32_t control)
{
    struct dma_channel *channel = DMA_CHANNEL(number);
    channel->CCR = 0;
    channel->CPAR = (uint32_t)data;
    channel->CMAR = (uint32_t)memory;
    channel->CNDTR = count;
    channel->CCR = control | DMA_CCR_MINC | DMA_CCR_EN;
}

static void adc_start(void)
{
    RCC->CFGR |= RCC_CFGR_ADCPRE_DIV6; /* 12 MHz */
    RCC->APB2ENR |= RCC_APB2ENR_ADC1EN;
    GPIOA->CRL &= ~0xFFFF000Fu; /* PA0 and PA4 to PA7: analog */
    ADC1->CR2 = ADC_CR2_ADON | ADC_CR2_TSVREFE;
    tick_sleep(1);
    ADC1->CR2 |= ADC_CR2_RSTCAL;
    while (ADC1->CR2 & ADC_CR2_RSTCAL) {
    }
    ADC1->CR2 |= ADC_CR2_CAL;
    while (ADC1->CR2 & ADC_CR2_CAL) {
    }
    for (uint32_t n = 0; n < COUNT; n++) {
        volatile uint32_t *sequence = n < 6u ? &ADC1->SQR3 : &ADC1->SQR2;
        volatile uint32_t *times = channels[n] < 10u ? &ADC1->SMPR2 : &ADC1->SMPR1;
        *sequence |= (uint32_t)channels[n] << 5u * (n % 6u);
        *times |= ADC_SAMPLE_239_5 << 3u * (channels[n] % 10u); /* 21 us a conversion: the sensor wants 17.1 */
    }
    ADC1->SQR1 = (COUNT - 1u) << 20;
    ADC1->CR1 = ADC_CR1_SCAN;
    dma_start(DMA_ADC1, &ADC1->DR, samples, COUNT, DMA_CCR_CIRC | DMA_CCR_PSIZE_16 | DMA_CCR_MSIZE_16);
    ADC1->CR2 |= ADC_CR2_CONT | ADC_CR2_DMA | ADC_CR2_EXTTRIG | ADC_CR2_EXTSEL_SWSTART;
    ADC1->CR2 |= ADC_CR2_SWSTART;
}

/* Microvolts, with the supply that the reference shows. */
static uint32_t microvolts(uint32_t sample, uint32_t reference)
{
    const uint32_t product = sample * REFERENCE_MV;
    return product / reference * 1000u + product % reference * 1000u / reference;
}

static void say(void)
{
    const uint32_t reference = samples[COUNT - 1u];
    if (reference == 0) {
        return;
    }
    length = 0;
    put("analog: supply ");
    put_number((int32_t)((STEPS * REFERENCE_MV + reference / 2u) / reference));
    put(" mV, chip ");
    /* From 0 degC on, so that the division rounds to the nearest. */
    put_number((V25_UV + 25 * SLOPE_UV + SLOPE_UV / 2 - (int32_t)microvolts(samples[PIN_COUNT], reference)) / SLOPE_UV);
    put(" degC");
    for (uint32_t n = 0; n < PIN_COUNT; n++) {
        put(", PA");
        put_number(channels[n]);
        put(" ");
        put_number((int32_t)((microvolts(samples[n], reference) + 500u) / 1000u));
        put(" mV");
    }
    put("\n");
    dma_start(DMA_USART1_TX, &USART1->DR, text, length, DMA_CCR_DIR_TO_PERIPHERAL);
}

int main(void)
{
    board_start();
    RCC->AHBENR |= RCC_AHBENR_DMA1EN;
    USART1->CR3 = USART_CR3_DMAT;
    adc_start();
    for (;;) {
        tick_sleep(TICKS_PER_S / 10u);
        say();
    }
}
