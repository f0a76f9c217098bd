/*
 * Sends requests to a slave program for an ATmega328P in simavr, and prints its response times.
 *
 *   run_answer program.elf HERTZ PHASES SCENE...
 *
 * A SCENE is one request or several in hexadecimal digits, with + between them. Each is played PHASES times, the end of
 * its last request at one of that many parts of a millisecond, so that the millisecond's interrupt occurs at all points
 * around it. A line is printed for each request: the clock cycle at which its last byte was complete, the cycles until
 * the first byte of the answer is written to the UART, and the answer; 0 and - if there is none within a millisecond.
 * The last line is the most bytes of stack in use. Status 1: the program ended, or did not answer the last request of a
 * scene.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_elf.h>

#define UCSR0A 0xC0 /* addresses in data space */
#define UBRR0L 0xC4
#define UBRR0H 0xC5
#define RXC0 0x80
#define U2X0 0x02
#define SPL 0x5D
#define SPH 0x5E
#define LIMIT 400000u /* most cycles to wait for an answer */

static uint8_t answer[256];
static unsigned answered;
static avr_cycle_count_t first;
static avr_cycle_count_t latest;
static avr_cycle_count_t per_byte; /* of the previous request, on the line */
static unsigned lowest = 0xFFFFu; /* of the stack pointer */

static void written(struct avr_irq_t *irq, uint32_t value, void *context)
{
    const avr_t *avr = context;
    (void)irq;
    first = answered == 0u ? avr->cycle : first;
    latest = avr->cycle;
    answer[answered++ % sizeof answer] = (uint8_t)value;
}

/* Only simulated time passes: a sleep of the processor takes no real time. */
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

static bool is_received(const avr_t *avr)
{
    return (avr->data[UCSR0A] & RXC0) != 0;
}

/* Sends one byte when the program has read the previous one; it is complete when this returns. */
static void send(avr_t *avr, uint8_t byte)
{
    const avr_cycle_count_t begin = avr->cycle;
    while (is_received(avr)) {
        stop_after(avr, begin);
        step(avr);
    }
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
    while (!is_received(avr)) {
        stop_after(avr, begin);
        step(avr);
    }
}

static avr_uart_t *uart_of(const avr_t *avr)
{
    avr_io_t *io = avr->io_port;
    while (io != NULL && strcmp(io->kind, "uart") != 0) {
        io = io->next;
    }
    if (io == NULL) {
        fprintf(stderr, "run_answer: this simavr has no UART\n");
        exit(EXIT_FAILURE);
    }
    return (avr_uart_t *)io;
}

/* A byte has ten bits of eight clocks, times the divider that the program has set. simavr takes longer for a received
 * one, by an amount that depends on its version; so its UART is adjusted after the first request. */
static void keep_rate(avr_t *avr)
{
    static bool is_set;
    const unsigned divider = (((unsigned)avr->data[UBRR0H] << 8) | avr->data[UBRR0L]) + 1u;
    const unsigned wanted = 10u * ((avr->data[UCSR0A] & U2X0) != 0 ? 8u : 16u) * divider;
    if (!is_set) {
        avr_uart_t *const uart = uart_of(avr);
        uart->cycles_per_byte = uart->cycles_per_byte * wanted / per_byte;
        is_set = true;
    } else if (per_byte * 100u > wanted * 105u || per_byte * 100u < wanted * 95u) {
        fprintf(stderr, "run_answer: a byte takes %u cycles, not %u\n", (unsigned)per_byte, wanted);
        exit(EXIT_FAILURE);
    }
}

/* Sends a request of `digits` digits; returns the cycle at which its last byte was complete. */
static avr_cycle_count_t ask(avr_t *avr, const char *hex, size_t digits)
{
    const avr_cycle_count_t begin = avr->cycle;
    for (size_t at = 0u; at < digits; at += 2u) {
        const char pair[3] = {hex[at], hex[at + 1u], '\0'};
        send(avr, (uint8_t)strtoul(pair, NULL, 16));
    }
    per_byte = (avr->cycle - begin) / (digits / 2u);
    keep_rate(avr);
    return avr->cycle;
}

/* Waits until a request that begins now would be complete in this part of a millisecond. */
static void wait_for_phase(avr_t *avr, size_t digits, unsigned phase, unsigned phases)
{
    const avr_cycle_count_t period = avr->frequency / 1000u;
    const avr_cycle_count_t end = avr->cycle + per_byte * (digits / 2u);
    run_for(avr, (period * phase / phases + period - end % period) % period);
}

/* Waits for the answer and its end, and prints it. */
static void hear(avr_t *avr, avr_cycle_count_t complete, bool is_last)
{
    const avr_cycle_count_t millisecond = avr->frequency / 1000u;
    while (answered == 0u && (is_last || avr->cycle < complete + millisecond)) {
        stop_after(avr, complete);
        step(avr);
    }
    while (answered != 0u && avr->cycle < latest + millisecond) {
        step(avr);
    }
    printf("%llu %llu ", (unsigned long long)complete, answered == 0u ? 0ull : (unsigned long long)(first - complete));
    for (unsigned index = 0u; index < answered && index < sizeof answer; ++index) {
        printf("%02x", answer[index]);
    }
    printf("%s\n", answered == 0u ? "-" : "");
}

static void play(avr_t *avr, const char *scene, unsigned phase, unsigned phases)
{
    for (bool is_last = false; !is_last; ) {
        const size_t digits = strcspn(scene, "+");
        is_last = scene[digits] == '\0';
        if (is_last) {
            wait_for_phase(avr, digits, phase, phases);
        }
        answered = 0u;
        hear(avr, ask(avr, scene, digits), is_last);
        scene += digits + !is_last;
    }
}

static avr_t *start(const char *path, uint32_t hertz)
{
    static elf_firmware_t firmware;
    avr_t *const avr = avr_make_mcu_by_name("atmega328p");
    uint32_t flags = 0;

    if (avr == NULL || elf_read_firmware(path, &firmware) != 0) {
        fprintf(stderr, "run_answer: no %s\n", avr == NULL ? "atmega328p in this simavr" : path);
        exit(2);
    }
    avr_init(avr);
    firmware.frequency = hertz;
    avr_load_firmware(avr, &firmware);
    avr->sleep = no_sleep;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), written, avr);
    run_for(avr, avr->frequency / 1000u);
    return avr;
}

int main(int count, char **words)
{
    unsigned phases;
    avr_t *avr;

    if (count < 5 || (phases = (unsigned)strtoul(words[3], NULL, 10)) == 0u) {
        fprintf(stderr, "usage: run_answer PROGRAM.elf HERTZ PHASES SCENE...\n");
        return 2;
    }
    avr = start(words[1], (uint32_t)strtoul(words[2], NULL, 10));
    for (int word = 4; word < count; ++word) {
        for (unsigned phase = 0u; phase < phases; ++phase) {
            play(avr, words[word], phase, phases);
        }
    }
    printf("stack %u\n", (unsigned)avr->ramend - lowest);
    return EXIT_SUCCESS;
}
