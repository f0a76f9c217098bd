/*
 * 24 inputs and 24 outputs; bit 0 is number 1 (sections 7.1, 7.14 to 7.18).
 *
 * Output 1 follows input 1: T1 after it went high, T2 after it went low. Only the last edge counts, with the delay in
 * force when it came. A master may write output 1 as well: the last one wins, and a write does not cancel a pending
 * change.
 */
#ifndef IO_IMAGE_H
#define IO_IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#define IO_BYTES 3u /* of inputs, and of outputs */
#define IO_ALL 0xFFFFFFul

typedef struct io_image {
    uint32_t inputs;
    uint32_t outputs;
    uint16_t t1;    /* milliseconds until output 1 follows */
    uint16_t t2;
    uint32_t edge;  /* the millisecond in which input 1 changed last */
    uint16_t delay; /* from then on until output 1 follows */
    bool changing;  /* output 1 has not followed yet */
} io_image_t;

/* Begins with the levels of the inputs at power-up: no edge. */
void io_image_init(io_image_t *io, uint32_t inputs);

/* Takes the levels of the inputs, then updates output 1 if its delay is over. */
void io_image_advance(io_image_t *io, uint32_t inputs, uint32_t now);

/* Sets the outputs under the mask to those of `outputs`; the others stay. */
void io_image_write(io_image_t *io, uint32_t outputs, uint32_t mask);

/* Clears the outputs and cancels a pending change of output 1. */
void io_image_clear(io_image_t *io);

/* Reads bytes of the inputs, 0 for those that do not exist. */
void io_image_read_bytes(const io_image_t *io, uint8_t offset, uint8_t *bytes, uint8_t size);

/* Writes bytes of the outputs; those that do not exist are ignored. */
void io_image_write_bytes(io_image_t *io, uint8_t offset, const uint8_t *bytes, uint8_t size);

#endif
