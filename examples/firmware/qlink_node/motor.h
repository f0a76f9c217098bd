/*
 * The motor's own protocol: requests passed through (sections 7.8 and 7.9). The motor has one request at a time; a
 * newer one replaces the older. This motor answers after a delay with its request: connect yours in motor_take and
 * motor_advance.
 */
#ifndef MOTOR_H
#define MOTOR_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"
#include "qlink.h"

/* Bytes of an answer that fit into the response to a poll, besides the completion. */
#define MOTOR_MAX_DATA (QLINK_MOTOR_RESPONSE_POLL_RESPONSE_MAX_SIZE - 1u)

typedef struct motor {
    uint8_t answer[MOTOR_MAX_DATA];
    uint8_t size;
    bool asked;     /* there is a request */
    bool completed; /* the request is answered */
    uint32_t since; /* the millisecond of the request */
    uint16_t delay; /* milliseconds from then to the answer */
#if NODE_DIAGNOSTICS
    bool backwards; /* the answer is the request backwards, for tests */
#endif
} motor_t;

void motor_init(motor_t *motor, uint16_t delay);

/* Passes a request on. Returns whether it replaced one that was not completed. */
bool motor_take(motor_t *motor, const uint8_t *data, uint8_t size, uint32_t now);

/* Updates the motor: it may answer now. */
void motor_advance(motor_t *motor, uint32_t now);

/* Drops the request and its answer. */
void motor_forget(motor_t *motor);

#endif
