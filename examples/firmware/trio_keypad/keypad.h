/*
 * The behaviour of a membrane keypad on the Trio network.
 *
 * Until it is told its offset it is not in network mode: it sends nothing, neither keys nor the messages of others,
 * and what is sent to it is lost. All of that is counted.
 */
#ifndef KEYPAD_H
#define KEYPAD_H

#include "display.h"
#include "ring.h"

#define KEYPAD_KEYS 64u /* keys have the numbers 0 to 63 */

typedef struct keypad {
    trio_listener_t listener;
    ring_t ring;
    display_t display;
    uint8_t offset;          /* nodes along the ring to which it sends its keys; 0 until it was told */
    trio_keypad_mode_t mode;
    uint32_t down;           /* keys 0 to 23 that are held down, a bit each */
    uint32_t seen;           /* the same, as seen by the last look alone */
    uint32_t looked;         /* when that was, in milliseconds */
    bool watching;           /* there was a look */
    uint16_t early_keys;     /* key presses before it had its offset; counters wrap */
    uint16_t early_messages; /* messages to it before it had its offset */
    uint16_t lost_keys;      /* key presses that found no room */
    uint16_t ignored;        /* messages that mean nothing to a keypad */
} keypad_t;

/* As after power-up. */
void keypad_start(keypad_t *keypad);

/* Presses a key, or lets it go, which is sent in mode ON_OFF only. */
void keypad_press(keypad_t *keypad, uint8_t key);
void keypad_release(keypad_t *keypad, uint8_t key);

/* Looks at the keys when it is time to; bit 0 of the inputs is key 0. One that is down from the start sends nothing
 * before it was up. */
void keypad_look(keypad_t *keypad, uint32_t inputs, uint32_t now);

#endif
