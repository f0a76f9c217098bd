/*
 * A Q.link slave: an I/O and motion node that knows every command of the document. It has no clock, no pins and no
 * line of its own; main.c gives it those of the board. What the document leaves open it does as the virtual node of
 * qlinkgen does.
 *
 * Power-up and reset leave it stopped: it fills its FIFO and holds it until node_start, so that a broadcast starts
 * all nodes at the same time. A reset empties the FIFO, clears the outputs, forgets the counters and the motor's
 * request; number, settings, program and position stay.
 */
#ifndef NODE_H
#define NODE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "diagnostics.h"
#include "io_image.h"
#include "motor.h"
#include "options.h"
#include "path_fifo.h"
#include "program_store.h"
#include "qlink.h"
#include "settings.h"

/* The counter of the last message of a kind, by which a repeat is known. */
typedef struct counter {
    bool known;
    uint8_t last;
} counter_t;

struct node {
    qlink_receiver_t receiver;
    qlink_slave_t slave;
    node_settings_t settings;
    bool settings_changed; /* by a node_setup, and not stored yet */
    uint32_t now; /* the millisecond that it was told last */
    path_fifo_t path;
    io_image_t io;
    motor_t motor;
    program_store_t program;
    counter_t motion;
    counter_t sync;
    diagnostics_t diagnostics;
};

/* Is as after power-up, with the settings of settings_load. `inputs` are the levels that were there before: no edge. */
void node_init(node_t *node, uint32_t inputs, uint32_t now);

/* The same with other settings. */
void node_power_up(node_t *node, const node_settings_t *settings, uint32_t inputs, uint32_t now);

/* Fills the dispatch table with every command. */
void node_set_functions(node_t *node);

/* Lets happen what happens until now. Call it every millisecond. */
void node_advance(node_t *node, uint32_t inputs, uint32_t now);

/* Takes a byte of the line. Returns whether it completes a frame: node_answer handles it, before the next byte. */
bool node_receive(node_t *node, uint8_t byte);

/* Does what the frame says, if it is for this node. Returns the size of the answer to send, 0 where there is none.
 * `answer` takes QLINK_MAX_WIRE_SIZE bytes. */
size_t node_answer(node_t *node, uint8_t *answer);

/* Stores settings that have changed. Call it when the answer has been sent: writing may take its time. */
void node_sent(node_t *node);

/* Where the motor is, in encoder counts, whether or not the node tells it. */
int32_t node_position(const node_t *node);

#endif
