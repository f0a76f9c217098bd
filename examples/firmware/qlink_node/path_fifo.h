/*
 * The path words that wait, and the motor that takes one every 1/rate seconds (sections 7.10 to 7.13).
 *
 * A word is a displacement in encoder counts, 16 bits in two's complement. This motor is arithmetic; yours moves in
 * path_fifo_advance.
 */
#ifndef PATH_FIFO_H
#define PATH_FIFO_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"

typedef struct path_fifo {
    uint16_t words[NODE_FIFO]; /* a ring */
    uint8_t first;             /* the word that the motor is at */
    uint8_t waiting;           /* words in the FIFO; that one counts until it is done */
    uint8_t capacity;          /* words that fit, up to NODE_FIFO */
    bool started;              /* the motor takes words; a stopped one holds them */
    uint32_t position;         /* where the motor is, 32 bits in two's complement */
    uint32_t rate;             /* words a second */
    uint32_t then;             /* the millisecond up to which it has moved */
    uint32_t thousandths;      /* of the word that it is at: what is kept here never gets lost, so nothing drifts */
} path_fifo_t;

/* Makes it empty and stopped at position 0. A rate above a million words a second is one of a million: both empty
 * the FIFO within a millisecond. */
void path_fifo_init(path_fifo_t *path, uint8_t capacity, uint32_t rate, uint32_t now);

/* Moves along the words that are done by now. All other functions expect that this was called. */
void path_fifo_advance(path_fifo_t *path, uint32_t now);

/* Queues words, all or none; returns whether they fitted. */
bool path_fifo_push(path_fifo_t *path, const uint16_t *words, uint8_t count);

/* Lets the motor take words; a start of a started one changes nothing. */
void path_fifo_start(path_fifo_t *path);

/* Holds the words. The one that the motor is at begins again at the next start. */
void path_fifo_stop(path_fifo_t *path);

/* Throws away what waits; the position stays. */
void path_fifo_clear(path_fifo_t *path);

/* Words that still fit. */
uint8_t path_fifo_space(const path_fifo_t *path);

/* The motor is moving along the path. */
bool path_fifo_running(const path_fifo_t *path);

#endif
