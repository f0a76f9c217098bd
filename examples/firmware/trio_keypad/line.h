/* The serial line of this application, for the UART of the board: 8 data bits, no parity, 1 stop bit. */
#ifndef LINE_H
#define LINE_H

#include "trio.h"

#ifndef BOARD_BAUD
#define BOARD_BAUD 38400ul /* the document does not specify the baud rate */
#endif

#endif
