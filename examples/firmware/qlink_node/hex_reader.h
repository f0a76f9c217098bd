/*
 * Reads Intel HEX a character at a time and writes its bytes to memory from address 0 on. Records are not buffered: a
 * byte is stored as soon as it is read, and a wrong record makes the whole program invalid.
 */
#ifndef HEX_READER_H
#define HEX_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"

typedef struct hex_reader {
    uint8_t image[NODE_PROGRAM_SIZE];
    uint8_t used[(NODE_PROGRAM_SIZE + 7) / 8]; /* a bit for each byte of the program */
    uint16_t stored;   /* bytes of the program */
    uint32_t base;     /* of the addresses, by records 02 and 04 */
    uint32_t number;   /* the data bytes of the record, the last four of them */
    uint16_t offset;   /* address in the record */
    uint16_t position; /* digits of the record received so far, counted from 1; 0 between records */
    uint8_t count;     /* data bytes of the record */
    uint8_t type;
    uint8_t sum;       /* of all bytes of the record */
    uint8_t high;      /* the first digit of a pair */
    bool flawed;       /* the record is wrong; checked when it is complete */
    bool doubled;      /* a byte was given twice; checked at the end record */
    bool ended;        /* the end record was read */
} hex_reader_t;

/* Begins a program; the image is that of erased memory. */
void hex_reader_init(hex_reader_t *reader);

/* Reads a character. Returns false if the text is not Intel HEX or does not fit; begin again after that. */
bool hex_reader_take(hex_reader_t *reader, uint8_t character);

#endif
