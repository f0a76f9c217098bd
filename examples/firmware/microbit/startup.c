/* From reset to main, without a library. The addresses come from nrf51822.ld. */
#include <stddef.h>
#include <stdint.h>

typedef void (*handler_t)(void);

extern uint32_t stack_top[];
extern const uint32_t data_image[];
extern uint32_t data_start[];
extern uint32_t data_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];

int main(void);
void reset(void);
void timer0_interrupt(void);
void uart0_interrupt(void);

void reset(void)
{
    const uint32_t *from = data_image;
    for (uint32_t *to = data_start; to != data_end; ++to) {
        *to = *from;
        ++from;
    }
    for (uint32_t *to = bss_start; to != bss_end; ++to) {
        *to = 0u;
    }
    (void)main();
    for (;;) {
    }
}

/* A fault or an unexpected interrupt. A reset makes all pins inputs: with 10 kOhm to ground at DE the line is released;
 * if DE floats, the driver may hold it. */
static void fault(void)
{
    *(volatile uint32_t *)0xE000ED0Cu = 0x05FA0004u; /* AIRCR: SYSRESETREQ */
    for (;;) {
    }
}

#define INTERRUPT(number) (15 + (number)) /* after the stack pointer and the exceptions 1 to 15 */

struct vectors {
    uint32_t *stack;
    handler_t handlers[INTERRUPT(32)];
};

__attribute__((section(".vectors"), used)) static const struct vectors vectors = {
    stack_top,
    {
        [0] = reset,
        [1] = fault, /* NMI */
        [2] = fault, /* hard fault */
        [INTERRUPT(2)] = uart0_interrupt,
        [INTERRUPT(8)] = timer0_interrupt,
    },
};
