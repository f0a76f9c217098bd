/*
 * motion.response by hand for small chips, for this one message: the floor that the generated header is measured against.
 * The check value takes a few shifts a byte (avr-libc's on an AVR), and the frame is encoded in one pass.
 */
#ifndef FLOOR_H
#define FLOOR_H

#include <stdbool.h>
#include <stdint.h>
#if defined(__AVR__)
#include <util/crc16.h>
#endif

typedef struct {
    uint8_t node;
    uint8_t counter;
    uint8_t inputs;
    int32_t position;
    uint16_t motor_status;
    uint8_t fifo_space;
} floor_response;

enum {
    FLOOR_COMMAND = 0x20,
    FLOOR_LENGTH = 13, /* command, node, nine data bytes, check value */
    FLOOR_BODY = 14,   /* the same with the length byte */
    FLOOR_MAX_WIRE = 2 + 2 * FLOOR_BODY
};

/* The register of the check value: on 32 bits in the upper half, so that no step masks it. */
#if defined(__AVR__)
typedef uint16_t floor_register;
#define FLOOR_START 0xFFFFu
#else
typedef uint32_t floor_register;
#define FLOOR_START 0xFFFF0000u
#endif

__attribute__((always_inline)) static inline floor_register floor_crc(floor_register crc, uint8_t byte)
{
#if defined(__AVR__)
    return _crc_xmodem_update(crc, byte);
#else
    uint32_t fold = (crc >> 24) ^ byte;
    fold ^= fold >> 4;
    fold <<= 16;
    crc = (crc << 8) ^ fold;
    fold <<= 5;
    crc ^= fold;
    fold <<= 7;
    return crc ^ fold;
#endif
}

/* Encodes a message; returns the number of wire bytes, or 0. */
static inline uint8_t floor_encode(const floor_response *message, uint8_t *wire)
{
    uint8_t body[FLOOR_BODY - 2];
    const uint8_t *const position = (const uint8_t *)&message->position; /* both chips are little-endian */
    const uint8_t *const status = (const uint8_t *)&message->motor_status;
    const uint8_t *from = body;
    uint8_t *to = wire;
    floor_register crc = FLOOR_START;

    if ((uint8_t)(message->node - 1) > 15) {
        return 0;
    }
    body[0] = FLOOR_LENGTH;
    body[1] = FLOOR_COMMAND;
    body[2] = message->node;
    body[3] = message->counter;
    body[4] = message->inputs;
    body[5] = position[3];
    body[6] = position[2];
    body[7] = position[1];
    body[8] = position[0];
    body[9] = status[1];
    body[10] = status[0];
    body[11] = message->fifo_space;
    *to++ = 0xA5;
    *to++ = 0xA5;
    do {
        const uint8_t byte = *from++;
        crc = floor_crc(crc, byte);
        *to++ = byte;
        if (byte == 0xA5) {
            *to++ = 0x00;
        }
    } while (from != &body[sizeof body]);
    for (uint_fast8_t left = 2; left > 0; --left) {
        const uint8_t byte = (uint8_t)(crc >> (8 * sizeof crc - 8));
        crc = (floor_register)(crc << 8);
        *to++ = byte;
        if (byte == 0xA5) {
            *to++ = 0x00;
        }
    }
    return (uint8_t)(to - wire);
}

/* A receiver for one byte at a time. */
typedef struct {
    floor_register crc;
    uint8_t state; /* 0, 1: A5s seen; 2: preamble; 3: body; 4: body, after an A5 */
    uint8_t *to;
    uint8_t body[FLOOR_BODY];
} floor_receiver;

/* Returns whether the byte completes a correct frame of this message. */
static inline bool floor_receive(floor_receiver *receiver, uint8_t byte)
{
    const uint8_t state = receiver->state;

    if (byte == 0xA5) {
        if (state != 3) {
            receiver->state = (state == 0) ? 1 : 2;
            return false;
        }
        receiver->state = 4;
    } else if (state != 3) {
        receiver->state = 0;
        if (state == 4) {
            receiver->state = (byte == 0x00) ? 3 : 0;
            return false;
        }
        if (state != 2 || byte != FLOOR_LENGTH) {
            return false;
        }
        receiver->state = 3;
        receiver->crc = FLOOR_START;
        receiver->to = receiver->body;
    }
    *receiver->to++ = byte;
    receiver->crc = floor_crc(receiver->crc, byte);
    if (receiver->to != &receiver->body[FLOOR_BODY]) {
        return false;
    }
    receiver->state = (byte == 0xA5) ? 1 : 0;
    return receiver->crc == 0 && receiver->body[1] == FLOOR_COMMAND && (uint8_t)(receiver->body[2] - 1) <= 15;
}

/* The message that was received. */
static inline void floor_decode(floor_response *message, const floor_receiver *receiver)
{
    const uint8_t *const body = receiver->body;
    uint8_t *const position = (uint8_t *)&message->position;
    uint8_t *const status = (uint8_t *)&message->motor_status;
    message->node = body[2];
    message->counter = body[3];
    message->inputs = body[4];
    position[3] = body[5];
    position[2] = body[6];
    position[1] = body[7];
    position[0] = body[8];
    status[1] = body[9];
    status[0] = body[10];
    message->fifo_space = body[11];
}

#endif
