#include "motor.h"

void motor_init(motor_t *motor, uint16_t delay)
{
    motor->delay = delay;
#if NODE_DIAGNOSTICS
    motor->backwards = false;
#endif
    motor_forget(motor);
}

/* The index of the request's byte at an index of the answer. */
static uint8_t source(const motor_t *motor, uint8_t index, uint8_t size)
{
#if NODE_DIAGNOSTICS
    if (motor->backwards) {
        return (uint8_t)(size - 1u - index);
    }
#endif
    (void)motor;
    (void)size;
    return index;
}

bool motor_take(motor_t *motor, const uint8_t *data, uint8_t size, uint32_t now)
{
    const bool replaced = motor->asked && !motor->completed;
    uint8_t index;
    motor->size = (size < MOTOR_MAX_DATA) ? size : (uint8_t)MOTOR_MAX_DATA;
    for (index = 0u; index < motor->size; ++index) {
        motor->answer[index] = data[source(motor, index, size)];
    }
    motor->since = now;
    motor->asked = true;
    motor->completed = false;
    motor_advance(motor, now);
    return replaced;
}

void motor_advance(motor_t *motor, uint32_t now)
{
    if (motor->asked && !motor->completed && now - motor->since >= motor->delay) {
        motor->completed = true;
    }
}

void motor_forget(motor_t *motor)
{
    motor->asked = false;
    motor->completed = false;
}
