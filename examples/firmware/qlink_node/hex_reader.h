/*
 * Reads Intel HEX a character at a time and puts its bytes into memory from address 0 on. No record is buffered: a byte
 * is stored when it comes, and a record that turns out to be wrong makes the whole program worthless.
 */
#ifndef HEX_READER_H
#define HEX_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"

typedef struct hex_reader {
    uint8_t image[NODE_PROGRAM_SIZE];
    uint8_t used[(NODE_PROGRAM_SIZE + 7) / 8]; /* a bit for each byte that the program has */
    uint16_t stored;   /* bytes that the program has */
    uint32_t base;     /* of the addresses, by records 02 and 04 */
    uint32_t number;   /* the data bytes of the record, the last four of them */
    uint16_t offset;   /* address in the record */
    uint16_t position; /* digits of the record that have come, counted from 1; 0 between records */
    uint8_t count;     /* data bytes of the record */
    uint8_t type;
    uint8_t sum;       /* of all bytes of the record */
    uint8_t high;      /* the digit that waits for its second one */
    bool flawed;       /* the record is wrong, which counts when it is complete */
    bool doubled;      /* some byte came twice, which counts at the end record */
    bool ended;        /* the end record has come */
} hex_reader_t;

/* Begins a program; the image becomes that of erased memory. */
void hex_reader_init(hex_reader_t *reader);

/* Reads a character. Returns false where the text is no Intel HEX or does not fit: the reader is then of no use. */
bool hex_reader_take(hex_reader_t *reader, uint8_t character);

#endif
