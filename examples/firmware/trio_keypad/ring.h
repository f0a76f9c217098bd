/*
 * A node of the ring: takes its messages, sends the others on, and sends its own in between.
 *
 * A message to another node goes on while it still comes, a byte when the byte has come, with the address one lower in
 * its header and its end. Where it then turns out to be broken, it is ended by an end byte with the address 0, which
 * no header has: so the nodes behind drop it too. What stands between header and end is not looked at.
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
    RING_CLOSED,   /* no message is under way */
    RING_TAKING,   /* a message for this node */
    RING_PASSING,  /* a message for another one */
    RING_BLOCKING, /* the same, while nothing may be sent through this node */
    RING_HUNTING   /* behind a fault that was counted: only a header is of interest */
} ring_state_t;

typedef struct ring {
    trio_receiver_t receiver;   /* of the messages to this node */
    trio_listener_t *listener;  /* gets them */
    ring_state_t state;
    bool passes;                /* messages to others are sent on at all */
    uint8_t header;             /* of the message under way */
    uint16_t count;             /* its bytes behind the header, where it is for another node */
    uint32_t last;              /* when the last byte came, in milliseconds */
    uint8_t on[64];             /* bytes to be sent on */
    uint8_t on_size;
    uint8_t own[KEYPAD_QUEUE];  /* own messages that wait */
    uint16_t own_size;
    uint16_t taken;             /* messages to this node that were in order; counters wrap */
    uint16_t passed;            /* messages sent on to their end */
    uint16_t blocked;           /* messages not sent on */
    uint16_t cut_short;         /* broken messages whose head was sent on */
    uint16_t frame_faults;      /* incomplete or corrupt messages, and bytes in none */
    uint16_t crc_faults;        /* variables to this node with a wrong check value */
} ring_t;

/* As after power-up. The listener stays. */
void ring_start(ring_t *ring, trio_listener_t *listener);

/* Whether there is room for what the next byte may have sent on. */
bool ring_has_room(const ring_t *ring);

/* Takes the next byte from the node before. */
void ring_receive(ring_t *ring, uint8_t byte, uint32_t now);

/* Gives up a message that does not go on. */
void ring_poll(ring_t *ring, uint32_t now);

/* Queues an own message, a whole frame; false where it has no room, and was not taken. */
bool ring_send(ring_t *ring, const uint8_t *frame, size_t size);

/* Sends what is to be sent on, else one own message; false when there was nothing to do. */
bool ring_transmit(ring_t *ring);

#endif
