/*
 * Runs a firmware on simavr, with the UART of the chip on a pty:
 *
 *   run_simavr [--hertz 18432000] firmware.elf
 *
 * The first line it prints is the path of the pty. SIGTERM and SIGINT end it.
 *
 * It has its own pty instead of libsimavr's uart_pty: that one leaves a link with a fixed name in /tmp, prints before
 * the path, and delivers bytes only after the sleep of the chip. Here they end the sleep. Simulated time follows real
 * time while the chip sleeps; otherwise it runs at full speed, and the next sleep makes up the difference.
 */
#define _GNU_SOURCE

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <avr_extint.h>
#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_elf.h>

#define CHIP "atmega328p"
#define DEFAULT_HERTZ 18432000u
#define UART '0'
#define BUFFER_SIZE 256u
#define LOOK_AFTER 20000u /* instructions without a sleep until the pty is polled */
#define SHORTEST_NS 50000 /* shorter sleeps of a process last longer than requested */
#define SEND_MS 100       /* without a reader for so long, the rest is dropped, as on a wire */

typedef struct buffer {
    uint8_t bytes[BUFFER_SIZE];
    size_t size;
    size_t done;
} buffer_t;

static FILE *output; /* of this program; messages of the simulator go to stderr */
static int line = -1;
static buffer_t to_chip;
static buffer_t from_chip;
static bool full; /* the UART of the simulator is full */
static avr_irq_t *input;
static struct timespec started;
static volatile sig_atomic_t stopping;

static void die(const char *what)
{
    perror(what);
    exit(EXIT_FAILURE);
}

static void on_stop(int number)
{
    (void)number;
    stopping = 1;
}

static void open_line(void)
{
    struct termios settings;
    const char *path;
    int port;
    line = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (line < 0 || grantpt(line) != 0 || unlockpt(line) != 0 || (path = ptsname(line)) == NULL) {
        die("pty");
    }
    /* This end of the pty is never closed: the line does not hang up when a master closes its end. */
    port = open(path, O_RDWR | O_NOCTTY);
    if (port < 0 || tcgetattr(port, &settings) != 0) {
        die(path);
    }
    cfmakeraw(&settings);
    if (tcsetattr(port, TCSANOW, &settings) != 0) {
        die(path);
    }
    (void)fprintf(output, "%s\n", path);
    (void)fflush(output);
}

/* ---- Bytes ---- */

static void give_chip(void)
{
    while (!full && to_chip.done < to_chip.size) {
        avr_raise_irq(input, to_chip.bytes[to_chip.done++]);
    }
}

static void read_line(void)
{
    if (to_chip.done == to_chip.size) {
        const ssize_t size = read(line, to_chip.bytes, sizeof to_chip.bytes);
        to_chip.size = (size > 0) ? (size_t)size : 0u;
        to_chip.done = 0u;
    }
    give_chip();
}

static void write_line(void)
{
    struct pollfd waiting = { .fd = line, .events = POLLOUT };
    size_t done = 0u;
    while (done < from_chip.size && poll(&waiting, 1, SEND_MS) > 0) {
        const ssize_t size = write(line, from_chip.bytes + done, from_chip.size - done);
        done += (size > 0) ? (size_t)size : 0u;
    }
    from_chip.size = 0u;
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    from_chip.bytes[from_chip.size++] = (uint8_t)value;
    if (from_chip.size == sizeof from_chip.bytes) {
        write_line();
    }
}

static void on_room(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    if (value != 0u) {
        full = false;
        give_chip();
    }
}

static void on_full(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    full = full || value != 0u;
}

/* ---- Time ---- */

/* Cycles of a real chip up to now. */
static int64_t real_cycles(const avr_t *avr)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)(now.tv_sec - started.tv_sec) * avr->frequency +
        (int64_t)(now.tv_nsec - started.tv_nsec) * avr->frequency / 1000000000;
}

static avr_cycle_count_t least(avr_cycle_count_t one, avr_cycle_count_t other)
{
    return (one < other) ? one : other;
}

/* The chip sleeps for so many cycles, or until a byte is received. */
static void on_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    struct pollfd waiting = { .fd = line, .events = (to_chip.done == to_chip.size) ? POLLIN : 0 };
    const int64_t end = (int64_t)(avr->cycle + cycles);
    const int64_t ahead = (end - real_cycles(avr)) * 1000000000 / avr->frequency;
    write_line();
    if (ahead >= SHORTEST_NS) {
        const struct timespec limit = { .tv_sec = ahead / 1000000000, .tv_nsec = ahead % 1000000000 };
        if (ppoll(&waiting, 1, &limit, NULL) > 0) {
            /* Woken early: subtract the rest of the sleep, since the caller adds all of it. The count stays above 0 in
             * the first sleep too, or the UART would time the byte for the end of it. */
            const int64_t left = end - real_cycles(avr);
            avr->cycle -= (left < 0) ? 0u : least(least((avr_cycle_count_t)left, cycles), avr->cycle);
        }
    }
    read_line();
}

/* ---- The chip ---- */

static void connect_uart(avr_t *avr)
{
    uint32_t flags = 0u;
    input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_OUTPUT), on_byte, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_OUT_XON), on_room, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_OUT_XOFF), on_full, NULL);
    /* Do not print the bytes on the terminal, and do not sleep when the status register is read. */
    (void)avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS(UART), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    (void)avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS(UART), &flags);
}

static avr_t *make_chip(const char *path, uint32_t hertz)
{
    static elf_firmware_t firmware;
    avr_t *const avr = avr_make_mcu_by_name(CHIP);
    if (avr == NULL) {
        (void)fprintf(stderr, "run_simavr: this libsimavr has no %s\n", CHIP);
        exit(EXIT_FAILURE);
    }
    if (elf_read_firmware(path, &firmware) != 0) {
        (void)fprintf(stderr, "run_simavr: %s is not an ELF firmware\n", path);
        exit(EXIT_FAILURE);
    }
    avr_init(avr);
    firmware.frequency = hertz;
    avr_load_firmware(avr, &firmware);
    avr->sleep = on_sleep;
    /* PD2 can interrupt: while it is low, simavr would poll it in each clock of a sleep. */
    avr_extint_set_strict_lvl_trig(avr, 0, 0);
    connect_uart(avr);
    return avr;
}

static int run(avr_t *avr)
{
    unsigned worked = 0u;
    int state = cpu_Running;
    while (!stopping && state != cpu_Done && state != cpu_Crashed) {
        state = avr_run(avr);
        worked = (state == cpu_Sleeping) ? 0u : worked + 1u;
        if (worked == LOOK_AFTER) {
            worked = 0u;
            write_line();
            read_line();
        }
    }
    if (state == cpu_Crashed) {
        (void)fprintf(stderr, "run_simavr: the firmware crashed at %#x\n", (unsigned)avr->pc);
    }
    return (state == cpu_Crashed) ? EXIT_FAILURE : EXIT_SUCCESS;
}

int main(int count, char **arguments)
{
    struct sigaction action = { .sa_handler = on_stop };
    const bool chosen = count == 4 && strcmp(arguments[1], "--hertz") == 0;
    const unsigned long hertz = chosen ? strtoul(arguments[2], NULL, 10) : DEFAULT_HERTZ;
    if ((!chosen && count != 2) || hertz == 0u || hertz > 100000000u) {
        (void)fprintf(stderr, "usage: run_simavr [--hertz %u] firmware.elf\n", DEFAULT_HERTZ);
        return 2;
    }
    output = fdopen(dup(STDOUT_FILENO), "w");
    if (output == NULL || dup2(STDERR_FILENO, STDOUT_FILENO) < 0) {
        die("stdout");
    }
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    avr_t *const avr = make_chip(arguments[count - 1], (uint32_t)hertz);
    (void)clock_gettime(CLOCK_MONOTONIC, &started);
    open_line();
    return run(avr);
}
