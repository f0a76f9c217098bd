/* Options of a build, such as -DKEYPAD_ROWS=2u. */
#ifndef OPTIONS_H
#define OPTIONS_H

/* Size of the display; at most 128 places, since CURSOR has a seven-bit place. */
#ifndef KEYPAD_ROWS
#define KEYPAD_ROWS 4u
#endif
#ifndef KEYPAD_COLUMNS
#define KEYPAD_COLUMNS 20u
#endif

/* Silence within a message until it is abandoned, in milliseconds. */
#ifndef KEYPAD_PATIENCE
#define KEYPAD_PATIENCE 500u
#endif

/* Time between two scans of the keys, in milliseconds. A change counts when two scans agree. */
#ifndef KEYPAD_DEBOUNCE
#define KEYPAD_DEBOUNCE 10u
#endif

/* Size of the queue of own messages in bytes; a key press takes 3. */
#ifndef KEYPAD_QUEUE
#define KEYPAD_QUEUE 192u
#endif

/* 1: answers diagnostic variables, for tests and service: see diagnostics.h. */
#ifndef KEYPAD_DIAGNOSTICS
#define KEYPAD_DIAGNOSTICS 0
#endif

#endif
