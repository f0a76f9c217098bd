/*
 * The queue of path words, and the motor that takes one every 1/rate seconds (sections 7.10 to 7.13).
 *
 * A word is a displacement in encoder counts, 16 bits in two's complement. This motor only computes its position; move
 * yours in path_fifo_advance.
 */
#ifndef PATH_FIFO_H
#define PATH_FIFO_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"

typedef struct path_fifo {
    uint16_t words[NODE_FIFO]; /* a ring */
    uint8_t first;             /* index of the word in progress */
    uint8_t waiting;           /* words in the FIFO, including the one in progress */
    uint8_t capacity;          /* capacity in words, up to NODE_FIFO */
    bool started;              /* the motor takes words; if stopped, the FIFO holds them */
    uint32_t position;         /* of the motor, 32 bits in two's complement */
    uint32_t rate;             /* words a second */
    uint32_t then;             /* the millisecond of the last update */
    uint32_t thousandths;      /* of the word in progress: the remainder is kept, so the rate does not drift */
} path_fifo_t;

/* Makes it empty and stopped at position 0. A rate above a million words a second counts as a million: both empty the
 * FIFO within a millisecond. */
void path_fifo_init(path_fifo_t *path, uint8_t capacity, uint32_t rate, uint32_t now);

/* Moves along the words that are done by now. Call it before any other function. */
void path_fifo_advance(path_fifo_t *path, uint32_t now);

/* Queues words, all or none; returns whether they fit. */
bool path_fifo_push(path_fifo_t *path, const uint16_t *words, uint8_t count);

/* Starts the motor; no effect if it is started already. */
void path_fifo_start(path_fifo_t *path);

/* Stops the motor and holds the words. The one in progress begins again at the next start. */
void path_fifo_stop(path_fifo_t *path);

/* Drops all words; the position stays. */
void path_fifo_clear(path_fifo_t *path);

/* Free places, in words. */
uint8_t path_fifo_space(const path_fifo_t *path);

/* The motor is moving along the path. */
bool path_fifo_running(const path_fifo_t *path);

#endif
