/* PWM by TIM1, encoders by TIM3 and TIM4, voltages by ADC1 and DMA1 channel 1, the tick by SysTick. */
#include "rover_board.h"

#include "board.h"
#include "f103_analog.h"
#include "f103_timers.h"
#include "uart.h"

#define VDDA_MV 3300u
#define ADC_FULL 4095u

static struct gpio *const port_of[] = {GPIOA, GPIOB};
enum { PORT_A, PORT_B };
static const uint8_t channels[VOLTAGES] = {0, 1, 4, 5}; /* of PA0, PA1, PA4, PA5 */
static volatile uint16_t converted[VOLTAGES];           /* written by DMA */
static volatile uint32_t ticks;
static uint16_t seen[SIDES];
static int32_t counts[SIDES];

void SysTick_Handler(void);
void SysTick_Handler(void)
{
    ticks = ticks + 1;
}

static void set_mode(unsigned port, unsigned bit, uint32_t mode)
{
    volatile uint32_t *half = bit < 8 ? &port_of[port]->CRL : &port_of[port]->CRH;
    unsigned shift = 4u * (bit % 8u);
    *half = (*half & ~(0xFu << shift)) | mode << shift;
}

static void pins_init(void)
{
    RCC->APB2ENR |= RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN;
    (void)RCC->APB2ENR;
#define OUTPUT(name, letter, bit) set_mode(PORT_##letter, bit, GPIO_OUTPUT_PUSH_PULL_2MHZ);
#define PWM(name, letter, bit) set_mode(PORT_##letter, bit, GPIO_ALTERNATE_PUSH_PULL_2MHZ);
#define INPUT(name, letter, bit) set_mode(PORT_##letter, bit, GPIO_INPUT_FLOATING);
#define ANALOG(name, letter, bit) set_mode(PORT_##letter, bit, GPIO_INPUT_ANALOG);
    ROVER_OUTPUTS(OUTPUT)
    ROVER_PWM(PWM)
    ROVER_ENCODERS(INPUT)
    ROVER_VOLTAGES(ANALOG)
}

static void pwm_start(void)
{
    RCC->APB2ENR |= RCC_APB2ENR_TIM1EN;
    (void)RCC->APB2ENR;
    TIM1->ARR = PWM_PERIOD - 1;
    TIM1->CCMR1 = TIM_CCMR_PWM1_FIRST;
    TIM1->CCMR2 = TIM_CCMR_PWM1_SECOND;
    TIM1->CCER = TIM_CCER_CC1E | TIM_CCER_CC4E;
    TIM1->BDTR = TIM_BDTR_MOE;
    TIM1->EGR = TIM_EGR_UG;
    TIM1->CR1 = TIM_CR1_ARPE | TIM_CR1_CEN;
}

static void encoder_start(struct tim *tim)
{
    tim->ARR = 0xFFFF;
    tim->CCMR1 = TIM_CCMR1_INPUTS;
    tim->SMCR = TIM_SMCR_SMS_ENCODER3;
    tim->CR1 = TIM_CR1_CEN;
}

static void adc_start(void)
{
    RCC->CFGR |= RCC_CFGR_ADCPRE_DIV6; /* 12 MHz: 14 at most */
    RCC->AHBENR |= RCC_AHBENR_DMA1EN;
    RCC->APB2ENR |= RCC_APB2ENR_ADC1EN;
    (void)RCC->APB2ENR;
    struct dma_channel *channel = DMA_CHANNEL(DMA_ADC1);
    channel->CPAR = (uint32_t)&ADC1->DR;
    channel->CMAR = (uint32_t)converted;
    channel->CNDTR = VOLTAGES;
    channel->CCR = DMA_CCR_MSIZE_16 | DMA_CCR_PSIZE_16 | DMA_CCR_MINC | DMA_CCR_CIRC | DMA_CCR_EN;
    for (unsigned n = 0; n < VOLTAGES; n++) {
        ADC1->SQR3 |= (uint32_t)channels[n] << 5 * n;
        ADC1->SMPR2 |= ADC_SAMPLE_71_5 << 3 * channels[n];
    }
    ADC1->SQR1 = (VOLTAGES - 1u) << 20;
    ADC1->CR1 = ADC_CR1_SCAN;
    ADC1->CR2 = ADC_CR2_DMA | ADC_CR2_EXTSEL_SWSTART | ADC_CR2_EXTTRIG | ADC_CR2_ADON;
    for (uint32_t started = ticks; ticks - started < 2;) {
        wait_for_interrupt(); /* the ADC is ready a microsecond after ADON (tSTAB) */
    }
    ADC1->CR2 |= ADC_CR2_RSTCAL;
    while (ADC1->CR2 & ADC_CR2_RSTCAL) {
    }
    ADC1->CR2 |= ADC_CR2_CAL;
    while (ADC1->CR2 & ADC_CR2_CAL) {
    }
    ADC1->CR2 |= ADC_CR2_SWSTART;
}

void rover_start(void)
{
    pins_init();
    clock_start();
    SYSTICK->LOAD = HCLK_HZ / TICKS_PER_S - 1u;
    SYSTICK->VAL = 0;
    SYSTICK->CTRL = SYSTICK_CTRL_CLKSOURCE_CORE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_ENABLE;
    RCC->APB1ENR |= RCC_APB1ENR_TIM3EN | RCC_APB1ENR_TIM4EN;
    (void)RCC->APB1ENR;
    encoder_start(TIM3);
    encoder_start(TIM4);
    pwm_start();
    uart_start();
    adc_start();
}

void rover_wait(void)
{
    uint32_t now = ticks;
    interrupts_off();
    while (ticks == now) {
        wait_for_interrupt();
        interrupts_on();
        interrupts_off();
    }
    interrupts_on();
    ADC1->CR2 |= ADC_CR2_SWSTART;
    /* Twice 32768 edges a tick would be lost, and no wheel is so fast. */
    struct tim *const timers[SIDES] = {TIM3, TIM4};
    for (unsigned side = 0; side < SIDES; side++) {
        uint16_t count = (uint16_t)timers[side]->CNT;
        counts[side] += (int16_t)(uint16_t)(count - seen[side]);
        seen[side] = count;
    }
}

int32_t rover_counts(enum rover_side side)
{
    return counts[side];
}

void rover_drive(enum rover_side side, int32_t duty)
{
    /* IN1, IN2 of the left side stand below those of the right one. */
    unsigned in1 = side == LEFT ? 12u : 14u;
    uint32_t on = duty < 0 ? in1 + 1u : in1, off = duty < 0 ? in1 : in1 + 1u;
    GPIOB->BSRR = 1u << on | 1u << (off + 16u);
    uint32_t high = (uint32_t)(duty < 0 ? -duty : duty);
    high = high > PWM_PERIOD ? PWM_PERIOD : high;
    if (side == LEFT) {
        TIM1->CCR1 = high;
    } else {
        TIM1->CCR4 = high;
    }
}

uint32_t rover_millivolts(enum rover_voltage which)
{
    return converted[which] * VDDA_MV / ADC_FULL;
}
