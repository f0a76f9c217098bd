/*
 * The settings of the build, at each power-up: changes by node_setup last until the node is switched off.
 *
 * Keep yours in EEPROM or flash, with a check value: settings_load falls back to these if the check value is wrong.
 */
#include "settings.h"

#include "options.h"

void settings_load(node_settings_t *settings)
{
    settings->number = NODE_NUMBER;
    settings->capacity = NODE_FIFO;
    settings->rate = NODE_RATE;
    settings->started = NODE_STARTED;
    settings->t1_tenths = NODE_T1_TENTHS;
    settings->t2_tenths = NODE_T2_TENTHS;
    settings->position_type = NODE_POSITION_TYPE;
    settings->serial = NODE_SERIAL;
    settings->motor_ms = NODE_MOTOR_MS;
}

void settings_store(const node_settings_t *settings)
{
    (void)settings;
}
