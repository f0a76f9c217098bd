/* The settings of a node after power-up, and their storage while it is off. */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct node_settings {
    uint8_t number;
    uint8_t capacity; /* path words, up to NODE_FIFO */
    uint32_t rate;    /* path words a second */
    bool started;     /* the motor takes words without a node_start, also after a reset */
    uint8_t t1_tenths;
    uint8_t t2_tenths;
    uint8_t position_type;
    uint32_t serial;
    uint16_t motor_ms;
} node_settings_t;

/* Reads the settings at power-up. */
void settings_load(node_settings_t *settings);

/* Called after the answer to a node_setup that has changed them. */
void settings_store(const node_settings_t *settings);

#endif
