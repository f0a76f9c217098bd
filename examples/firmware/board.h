/*
 * What an application needs of a board: one serial line, a clock of a millisecond, and as many pins as there are.
 *
 * A port is one folder: board.c with these functions, and port.mk with what the compiler has to be told. The line is
 * that of the application: its line.h defines BOARD_BAUD (and includes the header of the protocol), so a board.c
 * includes "line.h" where it sets up its UART. -DBOARD_BAUD=19200 on the command line wins.
 *
 * Receiving is interrupt-driven: the interrupt moves all waiting bytes into a ring buffer. Where the UART has a flag of
 * its own that is cleared by writing to it, the interrupt clears it first and then reads: a byte that comes between
 * the two would lose its wake-up the other way round. Where reading the byte is what clears it, there is no order.
 *
 * All functions are for the main loop; none may be called from an interrupt.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Microseconds from the request to the driver: whoever asks has to let go of the line first. One bit, rounded up. */
#ifndef BOARD_TURNAROUND_US
#define BOARD_TURNAROUND_US ((1000000ul + BOARD_BAUD - 1u) / BOARD_BAUD)
#endif

/* Sets up clocks, pins, UART and tick, the direction pin first: the driver is off. Bytes are received from here on. */
void board_start(void);

/* Takes the oldest byte out of the receive buffer; false when there is none. */
bool board_receive(uint8_t *byte);

/* Waits for BOARD_TURNAROUND_US, then driver on, bytes out, last stop bit out, driver off. Blocks until then; receiving
 * goes on meanwhile. With size 0 it does nothing. A line without a direction needs no turnaround. */
void board_send(const uint8_t *bytes, size_t size);

/* Sleeps until an interrupt (a byte, the tick). A byte that came since board_receive found none is never missed. */
void board_wait(void);

/* Milliseconds since the start; wraps after 49 days, so only differences mean something. */
uint32_t board_milliseconds(void);

/* The 24 input lines, bit 0 is input 1. A board without pins returns 0. */
uint32_t board_inputs(void);

/* Sets the 24 output lines, bit 0 is output 1; those without a pin are ignored. */
void board_outputs(uint32_t outputs);

/* The direction pin of the RS485 driver: called by board_send around the bytes. */
void board_driver(bool transmit);

/* Bytes lost since the start because the receive buffer was full; stays at 65535. */
uint16_t board_overruns(void);

#endif
