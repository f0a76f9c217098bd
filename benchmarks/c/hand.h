/*
 * motion.response by hand, for this one message and for speed.
 * One table of 256 entries, one pass for check value and stuffing. The generated header is compared with it.
 */
#ifndef HAND_H
#define HAND_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t node;
    uint8_t counter;
    uint8_t inputs;
    int32_t position;
    uint16_t motor_status;
    uint8_t fifo_space;
} hand_response;

enum {
    HAND_COMMAND = 0x20,
    HAND_LENGTH = 13, /* command, node, nine data bytes, check value */
    HAND_BODY = 14,   /* the same with the length byte */
    HAND_MAX_WIRE = 2 + 2 * HAND_BODY
};

static uint16_t hand_table[256];

static inline void hand_init(void)
{
    for (unsigned i = 0; i < 256; ++i) {
        unsigned crc = i << 8;
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc << 1) ^ ((crc & 0x8000u) ? 0x1021u : 0u);
        }
        hand_table[i] = (uint16_t)crc;
    }
}

static inline uint16_t hand_crc(uint16_t crc, uint8_t byte)
{
    return (uint16_t)((crc << 8) ^ hand_table[(crc >> 8) ^ byte]);
}

static inline uint8_t *hand_put(uint8_t *to, uint8_t byte)
{
    *to++ = byte;
    if (byte == 0xA5) {
        *to++ = 0x00;
    }
    return to;
}

/* Encodes a message; returns the number of wire bytes, or -1. */
static inline int hand_encode(const hand_response *message, uint8_t *wire, size_t capacity)
{
    const uint32_t position = (uint32_t)message->position;
    const uint8_t body[HAND_BODY - 2] = {
        HAND_LENGTH,
        HAND_COMMAND,
        message->node,
        message->counter,
        message->inputs,
        (uint8_t)(position >> 24),
        (uint8_t)(position >> 16),
        (uint8_t)(position >> 8),
        (uint8_t)position,
        (uint8_t)(message->motor_status >> 8),
        (uint8_t)message->motor_status,
        message->fifo_space,
    };
    uint16_t crc = 0xFFFF;
    uint8_t *to = wire;

    if (capacity < HAND_MAX_WIRE || message->node < 1 || message->node > 16) {
        return -1;
    }
    *to++ = 0xA5;
    *to++ = 0xA5;
    for (size_t i = 0; i < sizeof body; ++i) {
        crc = hand_crc(crc, body[i]);
        to = hand_put(to, body[i]);
    }
    to = hand_put(to, (uint8_t)(crc >> 8));
    to = hand_put(to, (uint8_t)crc);
    return (int)(to - wire);
}

/* Decodes the fields of an unstuffed body with a correct check value; returns 0, or -1. */
static inline int hand_fields(hand_response *message, const uint8_t *body)
{
    if (body[0] != HAND_LENGTH || body[1] != HAND_COMMAND || body[2] < 1 || body[2] > 16) {
        return -1;
    }
    message->node = body[2];
    message->counter = body[3];
    message->inputs = body[4];
    message->position =
        (int32_t)((uint32_t)body[5] << 24 | (uint32_t)body[6] << 16 | (uint32_t)body[7] << 8 | (uint32_t)body[8]);
    message->motor_status = (uint16_t)(body[9] << 8 | body[10]);
    message->fifo_space = body[11];
    return 0;
}

/* Decodes one whole frame; returns 0, or -1. */
static inline int hand_decode(hand_response *message, const uint8_t *wire, size_t size)
{
    uint8_t body[HAND_BODY];
    const uint8_t *from = wire + 2;
    const uint8_t *const end = wire + size;
    uint16_t crc = 0xFFFF;

    if (size < 2 + HAND_BODY || wire[0] != 0xA5 || wire[1] != 0xA5) {
        return -1;
    }
    for (size_t i = 0; i < HAND_BODY; ++i) {
        if (from == end) {
            return -1;
        }
        body[i] = *from++;
        crc = hand_crc(crc, body[i]);
        if (body[i] == 0xA5 && from != end && *from++ != 0x00) {
            return -1;
        }
    }
    return (crc == 0 && from == end) ? hand_fields(message, body) : -1;
}

/* A receiver for one byte at a time: returns 1 if it completed a correct frame. */
typedef struct {
    uint16_t crc;
    uint8_t state; /* 0, 1: A5s seen; 2: preamble; 3: body; 4: body, after an A5 */
    uint8_t at;
    uint8_t left;
    uint8_t body[31];
} hand_receiver;

static inline int hand_receive(hand_receiver *receiver, uint8_t byte)
{
    switch (receiver->state) {
    case 0:
    case 1:
        receiver->state = (uint8_t)((byte == 0xA5) ? receiver->state + 1 : 0);
        return 0;
    case 2:
        if (byte == 0xA5) {
            return 0;
        }
        receiver->state = (uint8_t)((byte >= 4 && byte <= 30) ? 3 : 0);
        receiver->body[0] = byte;
        receiver->at = 1;
        receiver->left = byte;
        receiver->crc = hand_crc(0xFFFF, byte);
        return 0;
    case 4:
        receiver->state = (uint8_t)((byte == 0x00) ? 3 : (byte == 0xA5) ? 2 : 0);
        return 0;
    default:
        receiver->body[receiver->at++] = byte;
        receiver->crc = hand_crc(receiver->crc, byte);
        if (--receiver->left) {
            receiver->state = (uint8_t)((byte == 0xA5) ? 4 : 3);
            return 0;
        }
        receiver->state = (uint8_t)(byte == 0xA5);
        return receiver->crc == 0;
    }
}

#endif
