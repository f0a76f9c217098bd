/* The kit on a Cortex-M3 (board lm3s6965evb) without any library: vectors, memory, the first UART, and the exit, which
 * the emulator learns by semihosting. */
#include <stdint.h>

void conformance_put(char character);
int KIT(void);
void start(void);
extern uint32_t stack_top[];
extern uint32_t data_load[];
extern uint32_t data_start[];
extern uint32_t data_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];
void *memcpy(void *to, const void *from, uintptr_t size);
void *memset(void *to, int value, uintptr_t size);

typedef void (*vector_t)(void);
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    vector_t reset;
    vector_t faults[14];
} vectors = {stack_top, start, {0}};

#define UART0_DATA (*(volatile uint32_t *)0x4000C000u)
#define UART0_FLAGS (*(volatile uint32_t *)0x4000C018u)
#define UART0_FULL 0x20u

void conformance_put(char character)
{
    while ((UART0_FLAGS & UART0_FULL) != 0u) {
    }
    UART0_DATA = (uint8_t)character;
}

/* Functions that the compiler calls by itself. */
void *memcpy(void *to, const void *from, uintptr_t size)
{
    volatile uint8_t *target = to;
    for (const uint8_t *source = from; size > 0u; --size) {
        *target++ = *source++;
    }
    return to;
}

void *memset(void *to, int value, uintptr_t size)
{
    volatile uint8_t *target = to;
    for (; size > 0u; --size) {
        *target++ = (uint8_t)value;
    }
    return to;
}

static void leave(int status)
{
    const uint32_t block[2] = {0x20026u, (uint32_t)status}; /* ADP_Stopped_ApplicationExit */
    register uint32_t operation __asm__("r0") = 0x20u;      /* SYS_EXIT_EXTENDED */
    register const uint32_t *argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xAB" : : "r"(operation), "r"(argument) : "memory");
}

void start(void)
{
    const uint32_t *load = data_load;
    for (uint32_t *at = data_start; at < data_end; ++at) {
        *at = *load++;
    }
    for (uint32_t *at = bss_start; at < bss_end; ++at) {
        *at = 0u;
    }
    leave(KIT());
    for (;;) {
    }
}
