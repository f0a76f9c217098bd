/*
 * ATmega328P. USART0 on PD0 and PD1, direction of the RS485 driver on PD2 (1: transmit). PD0 has its pull-up: RO floats
 * while the node sends.
 * Inputs 1 to 6 are PC0 to PC5, with pull-ups: a contact to ground is a 1. Outputs 1 to 6 are PB0 to PB5.
 */
#include "board.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/atomic.h>
#include <util/delay.h>

#include "line.h"

/* Double speed: eight clocks a bit. An int has 16 bits here, so the constants are marked long. */
#define BAUD_SETTING ((F_CPU + 4UL * BOARD_BAUD) / (8UL * BOARD_BAUD) - 1UL)
#define BAUD_CLOCKS (8UL * (BAUD_SETTING + 1UL) * BOARD_BAUD) /* F_CPU, if the rate were exact */
#if BAUD_SETTING > 4095 || 50 * BAUD_CLOCKS > 51 * F_CPU || 50 * BAUD_CLOCKS < 49 * F_CPU
#error "BOARD_BAUD cannot be made from F_CPU within 2 %: take a crystal for baud rates, such as 18.432 MHz"
#endif

#define TICK_CLOCKS ((F_CPU + 500) / 1000) /* one millisecond */

#define RING_SIZE 128u /* a power of two; the longest request has to fit */
#define DRIVER _BV(PD2)
#define RECEIVER _BV(PD0)
#define PINS 0x3Fu /* of port B, and of port C */

static volatile uint8_t ring[RING_SIZE]; /* volatile too: a byte is read before its place is freed */
static volatile uint8_t written; /* free-running, they wrap; their difference is the number of bytes waiting */
static volatile uint8_t taken;
static volatile uint16_t overruns;
static volatile uint32_t milliseconds;

ISR(TIMER1_COMPA_vect)
{
    ++milliseconds;
}

static void count_lost(void)
{
    if (overruns != UINT16_MAX) {
        ++overruns;
    }
}

/* Reading UDR0 is the acknowledgement. A second byte in the UART interrupts again. */
ISR(USART_RX_vect)
{
    const uint8_t status = UCSR0A; /* read first: it belongs to the byte in UDR0 */
    const uint8_t byte = UDR0;
    const uint8_t place = written;
    if ((status & _BV(DOR0)) != 0u) {
        count_lost();
    }
    if ((uint8_t)(place - taken) == RING_SIZE) {
        count_lost();
    } else {
        ring[place % RING_SIZE] = byte;
        written = (uint8_t)(place + 1u);
    }
}

void board_start(void)
{
    PORTD = RECEIVER; /* its pull-up; the direction pin is set first, and low */
    DDRD = DRIVER;
    PORTC = PINS;
    DDRB = PINS;

    OCR1A = (uint16_t)(TICK_CLOCKS - 1); /* before the timer runs, or its first period would be one clock */
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(WGM12) | _BV(CS10);

    UBRR0 = (uint16_t)BAUD_SETTING;
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);

    SMCR = _BV(SE); /* sleep mode idle: UART and timer keep running */
    sei();
}

bool board_receive(uint8_t *byte)
{
    const uint8_t place = taken;
    if (place == written) {
        return false;
    }
    *byte = ring[place % RING_SIZE];
    taken = (uint8_t)(place + 1u);
    return true;
}

void board_send(const uint8_t *bytes, size_t size)
{
    size_t index;
    if (size == 0u) {
        return; /* without data the transmit-complete flag is never set */
    }
    _delay_us(BOARD_TURNAROUND_US);
    board_driver(true);
    for (index = 0u; index < size; ++index) {
        while ((UCSR0A & _BV(UDRE0)) == 0u) {
        }
        /* The transmit-complete flag is cleared after the byte is written, not before it: only the end of this byte
         * can set it again, and interrupts are off in between. */
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
        {
            UDR0 = bytes[index];
            UCSR0A = _BV(TXC0) | _BV(U2X0);
        }
    }
    while ((UCSR0A & _BV(TXC0)) == 0u) {
    }
    board_driver(false);
}

void board_wait(void)
{
    cli();
    if (taken == written) {
        sei(); /* takes effect after the next instruction: no interrupt between the check and the sleep */
        sleep_cpu();
    }
    sei();
}

uint32_t board_milliseconds(void)
{
    uint32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now = milliseconds;
    }
    return now;
}

uint32_t board_inputs(void)
{
    return (uint8_t)~PINC & PINS;
}

void board_outputs(uint32_t outputs)
{
    PORTB = (uint8_t)outputs & PINS;
}

void board_driver(bool transmit)
{
    if (transmit) {
        PORTD |= DRIVER;
    } else {
        PORTD &= (uint8_t)~DRIVER;
    }
}

uint16_t board_overruns(void)
{
    uint16_t count;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        count = overruns;
    }
    return count;
}
