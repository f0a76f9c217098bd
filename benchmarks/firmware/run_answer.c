/*
 * Sends requests to a slave's program for an ATmega328P in simavr, and prints how long it takes to answer.
 *
 *   run_answer program.elf HERTZ HEX...
 *
 * Each HEX is a request. A line is printed for each: the clock cycles from its last byte being complete to the first
 * byte of the answer being written to the UART, then the answer. A last line tells how many bytes of stack were in use
 * at most. Status 1: the program ended, or did not answer.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_elf.h>

#define UCSR0A 0xC0 /* addresses in data space */
#define RXC0 0x80
#define SPL 0x5D
#define SPH 0x5E
#define SHIFT 97u /* cycles that each pause is longer than the one before: the clock ticks anywhere in a request */
#define LIMIT 400000u /* cycles that an answer may take: a guard */

static uint8_t answer[256];
static unsigned answered;
static avr_cycle_count_t first;
static avr_cycle_count_t latest;
static unsigned lowest = 0xFFFFu; /* that the stack pointer has been */

static void written(struct avr_irq_t *irq, uint32_t value, void *context)
{
    const avr_t *avr = context;
    (void)irq;
    first = answered == 0u ? avr->cycle : first;
    latest = avr->cycle;
    answer[answered++ % sizeof answer] = (uint8_t)value;
}

/* Time passes in the simulation alone: a processor that sleeps is not waited for. */
static void no_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

static void step(avr_t *avr)
{
    const unsigned pointer = ((unsigned)avr->data[SPH] << 8) | avr->data[SPL];
    const int state = avr_run(avr);
    lowest = pointer < lowest ? pointer : lowest;
    if (state == cpu_Done || state == cpu_Crashed) {
        fprintf(stderr, "run_answer: the program ended\n");
        exit(EXIT_FAILURE);
    }
}

static void run_for(avr_t *avr, avr_cycle_count_t cycles)
{
    const avr_cycle_count_t end = avr->cycle + cycles;
    while (avr->cycle < end) {
        step(avr);
    }
}

static void stop_after(const avr_t *avr, avr_cycle_count_t begin)
{
    if (avr->cycle > begin + LIMIT) {
        fprintf(stderr, "run_answer: nothing happened for %u cycles\n", LIMIT);
        exit(EXIT_FAILURE);
    }
}

/* Sends a request; returns the cycle at which its last byte was complete. A byte is given to simavr's UART when the one
 * before has come through, at the rate that it makes of the program's settings. */
static avr_cycle_count_t ask(avr_t *avr, const char *hex)
{
    avr_irq_t *const input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_cycle_count_t begin = avr->cycle;
    for (; hex[0] != '\0' && hex[1] != '\0'; hex += 2) {
        const char pair[3] = {hex[0], hex[1], '\0'};
        begin = avr->cycle;
        avr_raise_irq(input, (uint32_t)strtoul(pair, NULL, 16));
        while ((avr->data[UCSR0A] & RXC0) == 0) {
            stop_after(avr, begin);
            step(avr);
        }
        begin = avr->cycle;
        if (hex[2] != '\0') {
            while ((avr->data[UCSR0A] & RXC0) != 0) {
                stop_after(avr, begin);
                step(avr);
            }
        }
    }
    return begin;
}

int main(int count, char **words)
{
    static elf_firmware_t firmware;
    avr_t *avr;
    uint32_t flags = 0;

    if (count < 4 || elf_read_firmware(words[1], &firmware) != 0) {
        fprintf(stderr, "usage: run_answer PROGRAM.elf HERTZ HEX...\n");
        return 2;
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if (avr == NULL) {
        fprintf(stderr, "run_answer: this simavr has no atmega328p\n");
        return 2;
    }
    avr_init(avr);
    firmware.frequency = (uint32_t)strtoul(words[2], NULL, 10);
    avr_load_firmware(avr, &firmware);
    avr->sleep = no_sleep;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), written, avr);
    run_for(avr, firmware.frequency / 1000u);
    for (int word = 3; word < count; ++word) {
        avr_cycle_count_t complete;
        answered = 0u;
        complete = ask(avr, words[word]);
        while (answered == 0u) {
            stop_after(avr, complete);
            step(avr);
        }
        while (avr->cycle < latest + firmware.frequency / 1000u) {
            step(avr);
        }
        run_for(avr, (avr_cycle_count_t)word * SHIFT);
        printf("%llu ", (unsigned long long)(first - complete));
        for (unsigned index = 0u; index < answered && index < sizeof answer; ++index) {
            printf("%02x", answer[index]);
        }
        printf("\n");
    }
    printf("stack %u\n", (unsigned)avr->ramend - lowest);
    return EXIT_SUCCESS;
}
