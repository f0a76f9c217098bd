/* What a program of the comparison does with motion.response: FLOOR the code written by hand for it, else the header. */
#ifndef COMPARED_H
#define COMPARED_H

#if defined(FLOOR)
#include "floor.h"

typedef floor_response message_t;
static floor_receiver receiver;
static uint8_t wire[FLOOR_MAX_WIRE];

static inline void start(void)
{
    receiver.state = 0;
}

static inline int encode_message(const message_t *message)
{
    return floor_encode(message, wire);
}

static inline bool receive_message(message_t *message, uint8_t byte)
{
    if (!floor_receive(&receiver, byte)) {
        return false;
    }
    floor_decode(message, &receiver);
    return true;
}
#else
#include "qlink.h"

typedef struct {
    uint8_t node;
    qlink_motion_response_t values;
} message_t;
static qlink_receiver_t receiver;
static uint8_t wire[QLINK_MOTION_RESPONSE_MAX_WIRE_SIZE];

static inline void start(void)
{
    qlink_receiver_init(&receiver);
}

static inline int encode_message(const message_t *message)
{
    return qlink_motion_response_to_frame(&message->values, message->node, wire, sizeof wire);
}

static inline bool receive_message(message_t *message, uint8_t byte)
{
    qlink_frame_t frame;
    if (qlink_receive(&receiver, byte) != QLINK_EVENT_FRAME) {
        return false;
    }
    frame = qlink_receiver_frame(&receiver);
    message->node = frame.node;
    return frame.id == QLINK_MOTION_RESPONSE_ID
        && qlink_motion_response_decode(&message->values, frame.payload, frame.size) == QLINK_OK;
}
#endif
#endif
