/* The registers of DMA1 and of the ADCs that these programs use: RM0008 11.12 and 13.4. */
#ifndef F103_ANALOG_H
#define F103_ANALOG_H

#include "f103.h"

struct dma_channel { volatile uint32_t CCR, CNDTR, CPAR, CMAR, reserved; };
struct dma { volatile uint32_t ISR, IFCR; struct dma_channel channel[7]; };
struct adc {
    volatile uint32_t SR, CR1, CR2, SMPR1, SMPR2, JOFR[4], HTR, LTR, SQR1, SQR2, SQR3, JSQR, JDR[4], DR;
};

#define DMA1 ((struct dma *)0x40020000u)
#define ADC1 ((struct adc *)0x40012400u)

#define RCC_AHBENR_DMA1EN (1u << 0)
#define RCC_APB2ENR_ADC1EN (1u << 9)
#define RCC_CFGR_ADCPRE_DIV4 (1u << 14)
#define RCC_CFGR_ADCPRE_DIV6 (2u << 14)

#define GPIO_INPUT_ANALOG 0x0u

#define DMA_CCR_EN (1u << 0)
#define DMA_CCR_DIR_TO_PERIPHERAL (1u << 4)
#define DMA_CCR_CIRC (1u << 5)
#define DMA_CCR_MINC (1u << 7)
#define DMA_CCR_PSIZE_16 (1u << 8)
#define DMA_CCR_MSIZE_16 (1u << 10)
#define DMA_TCIF(channel) (2u << 4u * ((channel) - 1u))
/* Channels are numbered from 1. */
#define DMA_CHANNEL(number) (&DMA1->channel[(number) - 1u])
#define DMA_ADC1 1u
#define DMA_USART1_TX 4u

#define ADC_CR1_SCAN (1u << 8)
#define ADC_CR2_ADON (1u << 0)
#define ADC_CR2_CONT (1u << 1)
#define ADC_CR2_CAL (1u << 2)
#define ADC_CR2_RSTCAL (1u << 3)
#define ADC_CR2_DMA (1u << 8)
#define ADC_CR2_EXTSEL_SWSTART (7u << 17)
#define ADC_CR2_EXTTRIG (1u << 20)
#define ADC_CR2_SWSTART (1u << 22)
#define ADC_CR2_TSVREFE (1u << 23)
#define ADC_SAMPLE_71_5 6u
#define ADC_SAMPLE_239_5 7u
#define ADC_CHANNEL_TEMPERATURE 16u
#define ADC_CHANNEL_VREFINT 17u

#define USART_CR3_DMAT (1u << 7)

#endif
