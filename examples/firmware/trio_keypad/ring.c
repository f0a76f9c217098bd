#include "ring.h"

#include <string.h>

#include "board.h"

/* Most bytes between header and end: those of the longest message. */
#define MOST TRIO_MAX_FRAME_SIZE

void ring_start(ring_t *ring, trio_listener_t *listener)
{
    memset(ring, 0, sizeof *ring);
    ring->listener = listener;
}

bool ring_has_room(const ring_t *ring)
{
    return ring->on_size + 2u <= sizeof ring->on; /* the end of the old message and the header of the new one */
}

static void send_on(ring_t *ring, uint8_t byte)
{
    ring->on[ring->on_size] = byte;
    ++ring->on_size;
}

static bool is_open(const ring_t *ring)
{
    return ring->state == RING_TAKING || ring->state == RING_PASSING || ring->state == RING_BLOCKING;
}

/* The current message is broken: tell the nodes that have received its head. */
static void break_off(ring_t *ring)
{
    if (ring->state == RING_PASSING) {
        send_on(ring, RING_MARKER);
        ++ring->cut_short;
    }
    ++ring->frame_faults;
    ring->state = RING_HUNTING;
}

/* A byte of a message to this node. */
static void take(ring_t *ring, uint8_t byte)
{
    const trio_event_t event = trio_receive(&ring->receiver, byte);
    if (event == TRIO_EVENT_FRAME) {
        const trio_frame_t frame = trio_receiver_frame(&ring->receiver);
        ring->state = RING_CLOSED;
        if (trio_listener_dispatch(ring->listener, &frame) == TRIO_OK) {
            ++ring->taken;
        } else {
            ++ring->frame_faults;
        }
    } else if (event == TRIO_EVENT_CRC) {
        ring->state = RING_CLOSED;
        ++ring->crc_faults;
    } else if (event != TRIO_EVENT_NONE) {
        ring->state = ((byte & RING_MARKER) != 0u) ? RING_CLOSED : RING_HUNTING;
        ++ring->frame_faults;
    } else {
        /* the message continues */
    }
}

static void begin(ring_t *ring, uint8_t header)
{
    const uint8_t address = header & RING_ADDRESS;
    if (is_open(ring)) {
        break_off(ring);
    }
    ring->header = header;
    ring->count = 0u;
    if (address > RING_ONE_HOP && ring->passes) {
        ring->state = RING_PASSING;
        send_on(ring, (uint8_t)(header - RING_ONE_HOP));
    } else if (address > RING_ONE_HOP) {
        ring->state = RING_BLOCKING;
        ++ring->blocked;
    } else if (address == RING_ONE_HOP) {
        ring->state = RING_TAKING;
        trio_receiver_init(&ring->receiver);
        (void)trio_receive(&ring->receiver, header);
    } else {
        ring->state = RING_HUNTING;
        ++ring->frame_faults;
    }
}

/* The end of a message to another node. */
static void end(ring_t *ring, uint8_t byte)
{
    if (((byte ^ ring->header) & RING_ADDRESS) != 0u) {
        break_off(ring);
    } else if (ring->state == RING_PASSING) {
        send_on(ring, (uint8_t)(byte - RING_ONE_HOP));
        ++ring->passed;
    } else {
        /* it was blocked */
    }
    ring->state = RING_CLOSED;
}

/* A byte between header and end of a message to another node. */
static void pass(ring_t *ring, uint8_t byte)
{
    ++ring->count;
    if (ring->count > MOST) {
        break_off(ring);
    } else if (ring->state == RING_PASSING) {
        send_on(ring, byte);
    } else {
        /* it is blocked */
    }
}

void ring_receive(ring_t *ring, uint8_t byte, uint32_t now)
{
    const bool marked = (byte & RING_MARKER) != 0u;
    ring->last = now;
    if (marked && (byte & RING_TYPE) != 0u) {
        begin(ring, byte);
    } else if (ring->state == RING_TAKING) {
        take(ring, byte);
    } else if (is_open(ring) && marked) {
        end(ring, byte);
    } else if (is_open(ring)) {
        pass(ring, byte);
    } else if (ring->state == RING_CLOSED) {
        ring->state = RING_HUNTING;
        ++ring->frame_faults;
    } else {
        /* hunting */
    }
}

void ring_poll(ring_t *ring, uint32_t now)
{
    if (is_open(ring) && (uint32_t)(now - ring->last) > KEYPAD_PATIENCE) {
        break_off(ring);
    }
}

bool ring_send(ring_t *ring, const uint8_t *frame, size_t size)
{
    if (size > sizeof ring->own - ring->own_size) {
        return false;
    }
    memcpy(ring->own + ring->own_size, frame, size);
    ring->own_size = (uint16_t)(ring->own_size + size);
    return true;
}

/* Size of the oldest own message: up to its end byte. */
static size_t first_own(const ring_t *ring)
{
    size_t at = 1u;
    while ((ring->own[at] & RING_MARKER) == 0u) {
        ++at;
    }
    return at + 1u;
}

/* One at a time, so that a message of another node does not wait longer than necessary. */
static void send_own(ring_t *ring)
{
    const size_t size = first_own(ring);
    board_send(ring->own, size);
    ring->own_size = (uint16_t)(ring->own_size - size);
    memmove(ring->own, ring->own + size, ring->own_size);
}

bool ring_transmit(ring_t *ring)
{
    if (ring->on_size > 0u) {
        board_send(ring->on, ring->on_size);
        ring->on_size = 0u;
    } else if (ring->own_size > 0u && ring->state != RING_PASSING) {
        send_own(ring);
    } else {
        return false;
    }
    return true;
}
