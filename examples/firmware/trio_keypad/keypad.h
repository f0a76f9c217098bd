/*
 * The behaviour of a membrane keypad on the Trio network.
 *
 * Until it receives its offset it is not in network mode: it sends nothing, neither keys nor the messages of others,
 * and drops messages to it. All of these are counted.
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
    uint8_t offset;          /* number of nodes along the ring to the receiver of its keys; 0 until it is set */
    trio_keypad_mode_t mode;
    uint32_t down;           /* keys 0 to 23 held down, a bit each */
    uint32_t seen;           /* the same, in the last scan */
    uint32_t looked;         /* time of the last scan, in milliseconds */
    bool watching;           /* there was a scan */
    uint16_t early_keys;     /* key presses before it had its offset; counters wrap */
    uint16_t early_messages; /* messages to it before it had its offset */
    uint16_t lost_keys;      /* key presses that found no room */
    uint16_t ignored;        /* messages without a meaning for a keypad */
} keypad_t;

/* As after power-up. */
void keypad_start(keypad_t *keypad);

/* Presses or releases a key; the release is sent in mode ON_OFF only. */
void keypad_press(keypad_t *keypad, uint8_t key);
void keypad_release(keypad_t *keypad, uint8_t key);

/* Scans the keys when it is time to; bit 0 of the inputs is key 0. A key held down from the start sends nothing before
 * its release. */
void keypad_look(keypad_t *keypad, uint32_t inputs, uint32_t now);

#endif
