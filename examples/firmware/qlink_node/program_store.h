/*
 * Takes a program in pieces (section 7.6). Every acknowledged piece is stored. Pieces with a wrong counter, text that
 * is not Intel HEX or bytes that do not fit are not acknowledged, nor are those after them until the next opening.
 */
#ifndef PROGRAM_STORE_H
#define PROGRAM_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "hex_reader.h"

typedef enum program_state {
    PROGRAM_NONE,
    PROGRAM_LOADING, /* opened, and the end record not received */
    PROGRAM_THERE,   /* from its end record on */
    PROGRAM_FAULT    /* failed; until the next opening */
} program_state_t;

typedef enum program_verdict {
    PROGRAM_OPENED,
    PROGRAM_STORED,
    PROGRAM_REPEATED, /* acknowledged as well, and not stored again */
    PROGRAM_REFUSED   /* not to be acknowledged */
} program_verdict_t;

typedef struct program_store {
    hex_reader_t reader;
    program_state_t state;
    bool begun;   /* a piece has been stored since the opening */
    uint8_t last; /* its counter */
} program_store_t;

void program_store_init(program_store_t *store);

/* Takes a request; one with counter 0 and no text opens. */
program_verdict_t program_store_take(program_store_t *store, uint8_t counter, const uint8_t *text, uint8_t size);

#endif
