/*
 * The text display.
 *
 *   12          clears the display; the cursor goes home
 *   14          the cursor goes home, to the upper left
 *   20          the cursor becomes invisible
 *   27, 72, p   the cursor goes to place p, counted from the upper left along the rows
 *   13, 10      start of the row, next row
 *   32 to 126   is shown at the cursor, which moves on; after the last place follows the first
 *
 * A sequence may be spread over messages. Anything else is ignored and counted.
 */
#ifndef DISPLAY_H
#define DISPLAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "options.h"

#define DISPLAY_CELLS (KEYPAD_ROWS * KEYPAD_COLUMNS)

typedef char display_cells_fit_a_cursor_character[(DISPLAY_CELLS >= 1u && DISPLAY_CELLS <= 128u) ? 1 : -1];

typedef struct display {
    uint8_t cells[DISPLAY_CELLS]; /* row by row */
    uint8_t place;                /* of the cursor */
    bool cursor_visible;
    uint8_t escape;               /* characters received of 27, 72, p */
    uint16_t ignored;
} display_t;

/* Empty, as after power-up. */
void display_start(display_t *display);

void display_feed(display_t *display, const uint8_t *characters, size_t count);

#endif
