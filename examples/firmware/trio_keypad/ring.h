/*
 * A node of the ring: receives its messages, forwards the others, and sends its own in between.
 *
 * A message to another node is forwarded byte by byte as it is received, with the address reduced by one in its header
 * and its end. If it turns out to be broken, it is ended by an end byte with the address 0, which no header has: so
 * the nodes after this one drop it too. The bytes between header and end are not checked.
 */
#ifndef RING_H
#define RING_H

#include "options.h"
#include "trio.h"

/* Header and end byte (Message Format): 1 aaaa ttt, address and type; type 0 is an end. */
#define RING_MARKER 0x80u
#define RING_ADDRESS 0x78u
#define RING_ONE_HOP 0x08u
#define RING_TYPE 0x07u

typedef enum ring_state {
    RING_CLOSED,   /* no current message */
    RING_TAKING,   /* a message for this node */
    RING_PASSING,  /* a message for another node */
    RING_BLOCKING, /* the same, while this node may not forward */
    RING_HUNTING   /* after a counted fault: waiting for a header */
} ring_state_t;

typedef struct ring {
    trio_receiver_t receiver;   /* of the messages to this node */
    trio_listener_t *listener;  /* receives them */
    ring_state_t state;
    bool passes;                /* messages to other nodes are forwarded */
    uint8_t header;             /* of the current message */
    uint16_t count;             /* bytes after its header, if it is for another node */
    uint32_t last;              /* time of the last byte, in milliseconds */
    uint8_t on[64];             /* bytes to forward */
    uint8_t on_size;
    uint8_t own[KEYPAD_QUEUE];  /* queued own messages */
    uint16_t own_size;
    uint16_t taken;             /* correct messages to this node; counters wrap */
    uint16_t passed;            /* messages forwarded to their end */
    uint16_t blocked;           /* messages not forwarded */
    uint16_t cut_short;         /* broken messages whose head was forwarded */
    uint16_t frame_faults;      /* incomplete or corrupt messages, and bytes outside messages */
    uint16_t crc_faults;        /* variables to this node with a wrong check value */
} ring_t;

/* As after power-up. The listener stays. */
void ring_start(ring_t *ring, trio_listener_t *listener);

/* Whether there is room for the bytes that the next byte may forward. */
bool ring_has_room(const ring_t *ring);

/* Takes the next byte from the previous node. */
void ring_receive(ring_t *ring, uint8_t byte, uint32_t now);

/* Abandons a message that does not continue. */
void ring_poll(ring_t *ring, uint32_t now);

/* Queues an own message, a whole frame; false if it does not fit. */
bool ring_send(ring_t *ring, const uint8_t *frame, size_t size);

/* Sends the bytes to forward, else one own message; false if there was nothing to send. */
bool ring_transmit(ring_t *ring);

#endif
