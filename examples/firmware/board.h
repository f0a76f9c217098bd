/*
 * What an application needs of a board: one serial line, a clock of a millisecond, and as many pins as there are.
 *
 * A port is one folder: board.c with these functions, and port.mk with what the compiler has to be told. The line is
 * that of the application: its line.h defines BOARD_BAUD (and includes the header of the protocol), so a board.c
 * includes "line.h" where it sets up its UART. -DBOARD_BAUD=19200 on the command line wins.
 *
 * Receiving is interrupt-driven. The interrupt is acknowledged first, then all waiting bytes go into a ring buffer: a
 * byte that comes between the two would lose its wake-up if it were done the other way round.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Sets up clocks, pins, UART and tick. Bytes are received from here on. */
void board_start(void);

/* Takes the oldest byte out of the receive buffer; false when there is none. */
bool board_receive(uint8_t *byte);

/* Driver on, bytes out, last stop bit out, driver off; returns then. */
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
