/*
 * A Q.link slave: an I/O and motion node with every command of the document. It has no clock, pins or line of its own;
 * main.c passes those of the board. Behaviour that the document leaves open is that of qlinkgen's virtual node.
 *
 * After power-up and reset it is stopped: it fills its FIFO and holds it until node_start, so that a broadcast starts
 * all nodes at the same time. A reset empties the FIFO, clears the outputs, the counters and the motor's request, and
 * keeps number, settings, program and position.
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

/* The counter of the last message of a kind, to detect a repeat. */
typedef struct counter {
    bool known;
    uint8_t last;
} counter_t;

struct node {
    qlink_receiver_t receiver;
    qlink_slave_t slave;
    node_settings_t settings;
    bool settings_changed; /* changed by node_setup, and not stored yet */
    uint32_t now; /* the millisecond of the last update */
    path_fifo_t path;
    io_image_t io;
    motor_t motor;
    program_store_t program;
    counter_t motion;
    counter_t sync;
    diagnostics_t diagnostics;
};

/* State after power-up, with the settings of settings_load. `inputs` are the initial levels: they make no edge. */
void node_init(node_t *node, uint32_t inputs, uint32_t now);

/* The same with other settings. */
void node_power_up(node_t *node, const node_settings_t *settings, uint32_t inputs, uint32_t now);

/* Fills the dispatch table with every command. */
void node_set_functions(node_t *node);

/* Updates the node to the present time. Call it every millisecond. */
void node_advance(node_t *node, uint32_t inputs, uint32_t now);

/* Takes a byte from the line. Returns true if it completes a frame: call node_answer before the next byte. */
bool node_receive(node_t *node, uint8_t byte);

/* Handles the frame, if it is for this node. Returns the size of the answer to send, 0 if there is none.
 * `answer` takes QLINK_MAX_WIRE_SIZE bytes. */
size_t node_answer(node_t *node, uint8_t *answer);

/* Stores changed settings. Call it after the answer is sent: writing may take long. */
void node_sent(node_t *node);

/* Position of the motor in encoder counts, whether or not the node reports it. */
int32_t node_position(const node_t *node);

#endif
