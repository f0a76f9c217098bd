/*
 * Diagnostics over the same line, for tests and service. A motor_request whose motor_data begins with 7E D1 is for the
 * node itself: 7E D1, operation, arguments. The next motor_response_poll returns the answer, once: the operation and
 * its data; FF and the operation if it is unknown or its arguments are wrong. A pending motor request is not affected.
 * Numbers are big-endian. Neither message counts in any counter.
 *
 * Only for builds with -DNODE_DIAGNOSTICS=1; in the others 7E D1 goes to the motor like other data.
 */
#ifndef DIAGNOSTICS_H
#define DIAGNOSTICS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "motor.h"
#include "options.h"
#include "qlink.h"
#include "settings.h"

typedef struct node node_t;

typedef enum diagnostics_operation {
    /* requests u16, motions u16, duplicates u16, words u32, overruns of the FIFO u16, jumps u16 */
    DIAGNOSTICS_MOTIONS = 0x01,
    /* syncs u16, repeated u16, missed u32, motor requests u16, replaced u16, refused presets u16, resets u16 */
    DIAGNOSTICS_OTHERS = 0x02,
    /* loads u16, pieces u16, repeated u16, refused u16, state u8 (program_state_t), bytes u16, CRC of the text u16 */
    DIAGNOSTICS_PROGRAM = 0x03,
    /* offset u16, count u8 (24 at most) -> bytes of the program's image */
    DIAGNOSTICS_IMAGE = 0x04,
    /* CRC u16 over all path words queued since power-up, each big-endian, and their number u32 */
    DIAGNOSTICS_WORDS = 0x05,
    /* inputs u24, power-up u8: from now on these replace the pins; with 1 without an edge */
    DIAGNOSTICS_INPUTS = 0x06,
    /* outputs u24, inputs u24, position i32, waiting u8, started u8, running u8, milliseconds u32, lost bytes u16 */
    DIAGNOSTICS_STATE = 0x07,
    /* capacity u8, rate u32, started u8, T1 u8, T2 u8, position type u8, serial u32, number u8, motor ms u16: power-up
     * with these settings, all counters 0. It follows the answer: until then the node keeps its old number and
     * settings. */
    DIAGNOSTICS_CONFIGURE = 0x08,
    /* position i32 */
    DIAGNOSTICS_POSITION = 0x09,
    /* mask u32: from now on only commands whose bit is 1 are answered. Bit 0 is node_setup; the order is that of
     * qlink_slave_t. The two commands that carry diagnostics are always answered. */
    DIAGNOSTICS_COMMANDS = 0x0A,
    /* 0: the motor answers with its request, 1: with its request backwards */
    DIAGNOSTICS_MOTOR = 0x0B,
    DIAGNOSTICS_WRONG = 0xFF
} diagnostics_operation_t;

#if NODE_DIAGNOSTICS

/* Counts since power-up; a reset by command keeps them. */
typedef struct counters {
    uint16_t requests; /* for this node, including those that it does not answer */
    uint16_t motions;
    uint16_t duplicates; /* motions with the counter of the last one, answered but not queued again */
    uint32_t words;
    uint16_t overruns; /* motions with more words than fitted */
    uint16_t jumps;    /* motions whose counter was not the last one plus 1 */
    uint16_t syncs;
    uint16_t repeated_syncs;
    uint32_t missed_syncs;
    uint16_t motor_requests;
    uint16_t replaced_motor_requests;
    uint16_t refused_presets;
    uint16_t resets;
    uint16_t program_loads;
    uint16_t program_pieces;
    uint16_t repeated_pieces;
    uint16_t refused_pieces;
} counters_t;

typedef struct diagnostics {
    counters_t counters;
    uint16_t words_check;  /* CRC over the path words */
    uint16_t text_check;   /* CRC over the text of the program */
    uint32_t inputs;       /* replace the pins */
    bool forced;           /* the inputs above are used */
    bool configuring;      /* power-up after the answer is sent */
    bool own;              /* the request being handled is a diagnostic one, and is not counted */
    uint8_t size;          /* of the pending answer, 0 if there is none */
    uint8_t answer[MOTOR_MAX_DATA];
    node_settings_t settings; /* for that power-up */
} diagnostics_t;

/* Counts in a build with diagnostics, does nothing without. */
#define COUNT(node, counter) ((void)++(node)->diagnostics.counters.counter)
#define COUNT_MORE(node, counter, number) ((void)((node)->diagnostics.counters.counter += (number)))

void diagnostics_init(diagnostics_t *diagnostics);

/* Continue the CRC over the path words, and the one over the program's text (restarted by an opening). */
void diagnostics_words(node_t *node, const uint16_t *words, uint8_t count);
void diagnostics_text(node_t *node, const uint8_t *text, uint8_t size);
void diagnostics_opened(node_t *node);

/* Returns whether a motor request was for the node itself. */
bool diagnostics_take(node_t *node, const qlink_motor_request_request_t *request);

/* Returns whether an answer was pending. */
bool diagnostics_poll(node_t *node, qlink_motor_response_poll_response_t *response);

/* Counts a handled frame, if it is a request to this node, and then runs the deferred power-up. `size`: of the answer,
 * 0 for none. */
void diagnostics_handled(node_t *node, const qlink_frame_t *frame, size_t size);

/* The inputs: those of the board, unless they are forced. */
uint32_t diagnostics_inputs(const node_t *node, uint32_t inputs);

#else

typedef uint8_t diagnostics_t;
#define COUNT(node, counter) ((void)(node))
#define COUNT_MORE(node, counter, number) ((void)(node), (void)(number))
#define diagnostics_init(diagnostics) ((void)(diagnostics))
#define diagnostics_words(node, words, count) ((void)(node))
#define diagnostics_text(node, text, size) ((void)(node))
#define diagnostics_opened(node) ((void)(node))
#define diagnostics_take(node, request) ((void)(node), false)
#define diagnostics_poll(node, response) ((void)(node), false)
#define diagnostics_handled(node, frame, size) ((void)(node), (void)(frame), (void)(size))
#define diagnostics_inputs(node, inputs) ((void)(node), (inputs))

#endif
#endif
