/* The serial line of this application, for the UART of the board: 8 data bits, no parity, 1 stop bit. */
#ifndef LINE_H
#define LINE_H

#include "qlink.h"

#ifndef BOARD_BAUD
#define BOARD_BAUD QLINK_BAUD
#endif

#endif
