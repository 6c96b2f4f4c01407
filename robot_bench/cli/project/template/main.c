/* Drives forward, and turns away from whatever the distance pins show.
 *
 * The whole program is in this file; board/ has what any program for this chip needs.
 * Change something, `make run`, and look at the report.
 */
#include "board/f103.h"
#include "board/wires.h"

#define CLOCK_HZ 8000000u /* the internal oscillator, which runs after reset */
#define TICKS_PER_S 100u
#define BAUD 115200u

struct action {
    const char *text;
    int left, right; /* wheels, -4 to +3; one step is 62.5 mm/s */
};

static const struct action forward = {"forward\n", 3, 3};
static const struct action turn_left = {"turning left\n", -2, 2};
static const struct action turn_right = {"turning right\n", 2, -2};

static const struct wire distances[] = {DD1, DD2, DD3, DD4, DD5, DD6, DD7, DD8}; /* from left to right */
#define LEFT_AHEAD (1u << 2 | 1u << 3) /* DD3 and DD4 look 30 and 10 degrees to the left */
#define RIGHT_AHEAD (1u << 4 | 1u << 5) /* DD5 and DD6 to the right */

static const struct wire left_motor[] = {MOTOR1_COMM1, MOTOR1_COMM2, MOTOR1_COMM3};
static const struct wire right_motor[] = {MOTOR2_COMM1, MOTOR2_COMM2, MOTOR2_COMM3};
static const struct wire p2dx_con = P2DX_CON, rst = RST, usart1_tx = {GPIOA, 9};

static void set_mode(struct wire wire, uint32_t mode)
{
    volatile uint32_t *half = wire.bit < 8u ? &wire.port->CRL : &wire.port->CRH;
    uint32_t shift = 4u * (wire.bit % 8u);
    *half = (*half & ~(0xFu << shift)) | mode << shift;
}

static void set_level(struct wire wire, unsigned is_high)
{
    wire.port->BSRR = 1u << (is_high ? wire.bit : wire.bit + 16u);
}

static void drive_wheel(const struct wire *motor, int steps)
{
    uint32_t change = 0; /* all three wires are on one port: one write, so no value in between is seen */
    for (unsigned i = 0; i < 3; i++) {
        change |= 1u << ((unsigned)steps >> i & 1u ? motor[i].bit : motor[i].bit + 16u);
        set_mode(motor[i], GPIO_OUTPUT_PUSH_PULL_2MHZ);
    }
    motor[0].port->BSRR = change;
}

static unsigned read_distances(void) /* bit 0 = DD1 ... bit 7 = DD8; 1: something is near */
{
    unsigned seen = 0;
    for (unsigned i = 0; i < 8; i++) {
        seen |= (distances[i].port->IDR >> distances[i].bit & 1u) << i;
    }
    return seen;
}

static void print(const char *text)
{
    for (; *text != '\0'; text++) {
        while (!(USART1->SR & USART_SR_TXE)) {
        }
        USART1->DR = (uint8_t)*text;
    }
}

void SysTick_Handler(void) {} /* it only wakes the core; startup.c has it in the vector table */

static void sleep_ticks(unsigned ticks)
{
    for (; ticks > 0; ticks--) {
        wait_for_interrupt(); /* a sleeping program costs next to nothing to emulate */
    }
}

static void start(void)
{
    RCC->APB2ENR = RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_IOPCEN |
                   RCC_APB2ENR_USART1EN;
    AFIO->MAPR = AFIO_MAPR_SWJ_CFG_JTAG_OFF; /* PB3 and PB4 carry encoder 1; after reset JTAG has them */
    drive_wheel(left_motor, 0);
    drive_wheel(right_motor, 0);
    set_level(rst, 0); /* high would hold the adapter in reset */
    set_mode(rst, GPIO_OUTPUT_PUSH_PULL_2MHZ);
    set_level(p2dx_con, 1); /* asks the adapter to connect the robot */
    set_mode(p2dx_con, GPIO_OUTPUT_PUSH_PULL_2MHZ);
    set_mode(usart1_tx, GPIO_ALTERNATE_PUSH_PULL_2MHZ);
    USART1->BRR = (CLOCK_HZ + BAUD / 2u) / BAUD;
    USART1->CR1 = USART_CR1_UE | USART_CR1_TE;
    SYSTICK->LOAD = CLOCK_HZ / TICKS_PER_S - 1u;
    SYSTICK->CTRL = SYSTICK_CTRL_CLKSOURCE_CORE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_ENABLE;
}

int main(void)
{
    start();
    print("waiting for the robot\n");
    sleep_ticks(3u * TICKS_PER_S); /* no wire tells that the robot is connected */
    for (const struct action *now = 0;; sleep_ticks(1)) {
        unsigned seen = read_distances();
        const struct action *next = &forward;
        if (seen & (LEFT_AHEAD | RIGHT_AHEAD)) { /* once begun, a turn goes on until the way is free */
            next = now == &turn_left || now == &turn_right ? now : seen & LEFT_AHEAD ? &turn_right : &turn_left;
        }
        if (next != now) {
            now = next;
            print(now->text);
            drive_wheel(left_motor, now->left);
            drive_wheel(right_motor, now->right);
        }
    }
}
