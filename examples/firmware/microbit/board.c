/*
 * Board: BBC micro:bit, first version (Nordic nRF51822, Cortex-M0, 16 MHz).
 * Register names as in the nRF51 Series Reference Manual.
 */
#include "board.h"

#include "line.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define CLOCK_TASKS_HFCLKSTART REGISTER(0x40000000u)
#define CLOCK_EVENTS_HFCLKSTARTED REGISTER(0x40000100u)

#define UART_TASKS_STARTRX REGISTER(0x40002000u)
#define UART_TASKS_STARTTX REGISTER(0x40002008u)
#define UART_EVENTS_RXDRDY REGISTER(0x40002108u)
#define UART_EVENTS_TXDRDY REGISTER(0x4000211Cu)
#define UART_INTENSET REGISTER(0x40002304u)
#define UART_INTENCLR REGISTER(0x40002308u)
#define UART_ERRORSRC REGISTER(0x40002480u)
#define UART_ENABLE REGISTER(0x40002500u)
#define UART_PSELTXD REGISTER(0x4000250Cu)
#define UART_PSELRXD REGISTER(0x40002514u)
#define UART_RXD REGISTER(0x40002518u)
#define UART_TXD REGISTER(0x4000251Cu)
#define UART_BAUDRATE REGISTER(0x40002524u)
#define INTEN_RXDRDY (1u << 2)
#define ENABLE_ENABLED 4u
#define ERRORSRC_OVERRUN (1u << 0)
#define ERRORSRC_FRAMING (1u << 2)
#define ERRORSRC_BREAK (1u << 3)

#define TIMER_TASKS_START REGISTER(0x40008000u)
#define TIMER_TASKS_CAPTURE1 REGISTER(0x40008044u)
#define TIMER_EVENTS_COMPARE0 REGISTER(0x40008140u)
#define TIMER_SHORTS REGISTER(0x40008200u)
#define TIMER_INTENSET REGISTER(0x40008304u)
#define TIMER_PRESCALER REGISTER(0x40008510u)
#define TIMER_CC0 REGISTER(0x40008540u)
#define TIMER_CC1 REGISTER(0x40008544u)
#define SHORTS_COMPARE0_CLEAR 1u
#define INTEN_COMPARE0 (1u << 16)

#define GPIO_OUTSET REGISTER(0x50000508u)
#define GPIO_OUTCLR REGISTER(0x5000050Cu)
#define GPIO_IN REGISTER(0x50000510u)
#define GPIO_DIRSET REGISTER(0x50000518u)
#define GPIO_PIN_CNF(pin) REGISTER(0x50000700u + 4u * (pin))
#define PIN_CNF_INPUT 0x0Cu /* input, connected, pull-up */

#define NVIC_ISER REGISTER(0xE000E100u)
#define IRQ_UART0 (1u << 2)
#define IRQ_TIMER0 (1u << 8)

/* Wiring: numbers of P0 pins. TXD and RXD go to the USB chip of the board by default. */
#ifndef BOARD_PIN_TXD
#define BOARD_PIN_TXD 24u
#endif
#ifndef BOARD_PIN_RXD
#define BOARD_PIN_RXD 25u
#endif
/* P16 of the edge connector: high while sending; 10 kOhm to ground at DE hold it low until board_start. */
#define PIN_DIRECTION 16u
#define PIN_BUTTON_A 17u  /* input 1, low when pressed */
#define PIN_BUTTON_B 26u  /* input 2, low when pressed */
#define PIN_OUTPUT_1 3u   /* P0 of the edge connector */
#define PIN_OUTPUT_2 2u   /* P1 */
#define PIN_OUTPUT_3 1u   /* P2 */

/* The baud rate in units of 16 MHz / 2^32, of which the chip uses the upper 20 bits. */
#define STEPS 0x100000000ull
#define CLOCK 16000000u
#define BAUDRATE ((BOARD_BAUD * STEPS / CLOCK + 0x800u) / 0x1000u * 0x1000u)
#if BOARD_BAUD < 1200u || BOARD_BAUD > 1000000u
#error "BOARD_BAUD must be 1200 to 1000000: the UART has no others"
#elif 50u * BAUDRATE * CLOCK > 51u * BOARD_BAUD * STEPS || 50u * BAUDRATE * CLOCK < 49u * BOARD_BAUD * STEPS
#error "BOARD_BAUD cannot be made from 16 MHz within 2 %"
#endif

#define BIT_US ((1000000u + BOARD_BAUD - 1u) / BOARD_BAUD) /* rounded up */
#define TICK_US 1000u

static volatile uint8_t ring[256]; /* its indices wrap without a modulo */
static volatile uint8_t head;
static volatile uint8_t tail;
static volatile uint16_t overruns;
static volatile uint32_t milliseconds;

static void start_clock(void)
{
    CLOCK_TASKS_HFCLKSTART = 1u; /* the crystal: the internal oscillator is too inaccurate for a UART */
    while (CLOCK_EVENTS_HFCLKSTARTED == 0u) {
    }
    TIMER_PRESCALER = 4u; /* 1 MHz */
    TIMER_CC0 = TICK_US;
    TIMER_SHORTS = SHORTS_COMPARE0_CLEAR;
    TIMER_INTENSET = INTEN_COMPARE0;
    TIMER_TASKS_START = 1u;
}

static void start_pins(void)
{
    const uint32_t outputs = (1u << PIN_OUTPUT_1) | (1u << PIN_OUTPUT_2) | (1u << PIN_OUTPUT_3);
    GPIO_PIN_CNF(PIN_BUTTON_A) = PIN_CNF_INPUT;
    GPIO_PIN_CNF(PIN_BUTTON_B) = PIN_CNF_INPUT;
    GPIO_PIN_CNF(BOARD_PIN_RXD) = PIN_CNF_INPUT;
    GPIO_OUTCLR = outputs | (1u << PIN_DIRECTION);
    GPIO_OUTSET = 1u << BOARD_PIN_TXD; /* an idle line while the UART is off */
    GPIO_DIRSET = outputs | (1u << PIN_DIRECTION) | (1u << BOARD_PIN_TXD);
}

static void start_uart(void)
{
    UART_PSELTXD = BOARD_PIN_TXD;
    UART_PSELRXD = BOARD_PIN_RXD;
    UART_BAUDRATE = (uint32_t)BAUDRATE;
    UART_ENABLE = ENABLE_ENABLED;
    UART_EVENTS_RXDRDY = 0u;
    UART_INTENSET = INTEN_RXDRDY;
    UART_TASKS_STARTTX = 1u;
    UART_TASKS_STARTRX = 1u;
}

void board_start(void)
{
    start_pins(); /* first, since the crystal starts slowly: the driver is off from now on */
    start_clock();
    start_uart();
    NVIC_ISER = IRQ_UART0 | IRQ_TIMER0;
}

static void count_overrun(void)
{
    if (overruns != UINT16_MAX) {
        ++overruns;
    }
}

/* Receive errors since the last call. */
static uint32_t take_errors(void)
{
    const uint32_t errors = UART_ERRORSRC;
    UART_ERRORSRC = errors; /* writing a 1 clears it */
    return errors;
}

/* RXD is the output of a FIFO of six bytes. Each byte that moves into RXD sets the event; clearing it after the read
 * would miss the next one. If the ring is full, the rest waits in the FIFO until board_receive. A byte without stop bit
 * is dropped: its frame is lost, and the receiver finds the next one. */
void uart0_interrupt(void)
{
    const uint32_t errors = take_errors();
    if ((errors & ERRORSRC_OVERRUN) != 0u) {
        count_overrun();
    }
    if ((errors & (ERRORSRC_FRAMING | ERRORSRC_BREAK)) != 0u && UART_EVENTS_RXDRDY != 0u) {
        UART_EVENTS_RXDRDY = 0u;
        (void)UART_RXD;
    }
    while (UART_EVENTS_RXDRDY != 0u) {
        if ((uint8_t)(head + 1u) == tail) {
            UART_INTENCLR = INTEN_RXDRDY;
            break;
        }
        UART_EVENTS_RXDRDY = 0u;
        ring[head] = (uint8_t)UART_RXD;
        ++head;
    }
}

void timer0_interrupt(void)
{
    TIMER_EVENTS_COMPARE0 = 0u;
    ++milliseconds;
}

bool board_receive(uint8_t *byte)
{
    if (tail == head) {
        return false;
    }
    *byte = ring[tail];
    ++tail;
    UART_INTENSET = INTEN_RXDRDY; /* the ring has room again */
    return true;
}

static uint32_t microseconds(void)
{
    TIMER_TASKS_CAPTURE1 = 1u;
    return TIMER_CC1;
}

static void wait_microseconds(uint32_t duration)
{
    uint32_t before = microseconds();
    uint32_t left = duration + (duration > 0u ? 1u : 0u); /* the first tick may have passed already */
    while (left > 0u) {
        const uint32_t now = microseconds(); /* restarts at 0 with every tick */
        const uint32_t gone = now >= before ? now - before : now + TICK_US - before;
        left -= gone < left ? gone : left;
        before = now;
    }
}

/* The event means that a byte has been sent; TXD has no buffer. Waiting for it needs no timeout: the UART runs on the
 * same crystal as the processor. */
void board_send(const uint8_t *bytes, size_t size)
{
    if (size == 0u) {
        return;
    }
    wait_microseconds(BOARD_TURNAROUND_US);
    board_driver(true);
    for (size_t index = 0u; index < size; ++index) {
        UART_EVENTS_TXDRDY = 0u;
        UART_TXD = bytes[index];
        while (UART_EVENTS_TXDRDY == 0u) {
        }
    }
    wait_microseconds(BIT_US); /* the manual does not say whether this includes the stop bit */
    board_driver(false);
}

/* A masked interrupt wakes the processor all the same, and is taken after cpsie: none is lost in between. */
void board_wait(void)
{
    __asm volatile("cpsid i" ::: "memory");
    if (tail == head) {
        __asm volatile("wfi" ::: "memory");
    }
    __asm volatile("cpsie i" ::: "memory");
}

uint32_t board_milliseconds(void)
{
    return milliseconds;
}

uint32_t board_inputs(void)
{
    const uint32_t pressed = ~GPIO_IN;
    return ((pressed >> PIN_BUTTON_A) & 1u) | (((pressed >> PIN_BUTTON_B) & 1u) << 1);
}

static void set_pin(uint32_t pin, bool high)
{
    if (high) {
        GPIO_OUTSET = 1u << pin;
    } else {
        GPIO_OUTCLR = 1u << pin;
    }
}

void board_outputs(uint32_t outputs)
{
    set_pin(PIN_OUTPUT_1, (outputs & 1u) != 0u);
    set_pin(PIN_OUTPUT_2, (outputs & 2u) != 0u);
    set_pin(PIN_OUTPUT_3, (outputs & 4u) != 0u);
}

void board_driver(bool transmit)
{
    set_pin(PIN_DIRECTION, transmit);
}

uint16_t board_overruns(void)
{
    return overruns;
}
