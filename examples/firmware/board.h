/*
 * The board as the application sees it: one serial line, a millisecond clock, and the pins.
 *
 * A port is one folder: board.c with these functions, and port.mk with the compiler options. The application defines
 * the line: its line.h defines BOARD_BAUD (and includes the header of the protocol), so a board.c includes "line.h" to
 * set up its UART. -DBOARD_BAUD=19200 on the command line takes precedence.
 *
 * Receiving is interrupt-driven: the interrupt moves all waiting bytes into a ring buffer. If the receive flag of the
 * UART is cleared by a write, the interrupt clears it first and then reads: in the other order, a byte received between
 * the two would not interrupt. If reading the byte clears the flag, this does not matter.
 *
 * Call all functions from the main loop only, never from an interrupt.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Microseconds from the request to driver on: the master has to release the line first. One bit, rounded up. */
#ifndef BOARD_TURNAROUND_US
#define BOARD_TURNAROUND_US ((1000000ul + BOARD_BAUD - 1u) / BOARD_BAUD)
#endif

/* Sets up clocks, pins, UART and tick, the direction pin first: the driver is off. Receives bytes from then on. */
void board_start(void);

/* Takes the oldest byte from the receive buffer; false if it is empty. */
bool board_receive(uint8_t *byte);

/* Waits BOARD_TURNAROUND_US, turns the driver on, sends the bytes up to the last stop bit, turns the driver off. Blocks
 * until then; receiving continues. Does nothing for size 0. A line without direction control needs no turnaround. */
void board_send(const uint8_t *bytes, size_t size);

/* Sleeps until an interrupt (a byte, the tick). A byte received since board_receive returned false ends it at once. */
void board_wait(void);

/* Milliseconds since the start; wraps after 49 days, so use differences only. */
uint32_t board_milliseconds(void);

/* The 24 input lines, bit 0 is input 1. A board without pins returns 0. */
uint32_t board_inputs(void);

/* Sets the 24 output lines, bit 0 is output 1; bits without a pin are ignored. */
void board_outputs(uint32_t outputs);

/* The direction pin of the RS485 driver: board_send calls it before and after the bytes. */
void board_driver(bool transmit);

/* Bytes lost since the start because the receive buffer was full; saturates at 65535. */
uint16_t board_overruns(void);

#endif
