#include "motor.h"

void motor_init(motor_t *motor, uint16_t delay)
{
    motor->delay = delay;
    motor->backwards = false;
    motor_forget(motor);
}

bool motor_take(motor_t *motor, const uint8_t *data, uint8_t size, uint32_t now)
{
    const bool replaced = motor->asked && !motor->completed;
    uint8_t index;
    motor->size = (size < MOTOR_MAX_DATA) ? size : (uint8_t)MOTOR_MAX_DATA;
    for (index = 0u; index < motor->size; ++index) {
        motor->answer[index] = data[motor->backwards ? size - 1u - index : index];
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
