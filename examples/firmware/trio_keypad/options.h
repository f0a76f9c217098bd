/* What may be chosen when the application is built, such as -DKEYPAD_ROWS=2u. */
#ifndef OPTIONS_H
#define OPTIONS_H

/* Size of the display; at most 128 places, since CURSOR names a place by a seven-bit character. */
#ifndef KEYPAD_ROWS
#define KEYPAD_ROWS 4u
#endif
#ifndef KEYPAD_COLUMNS
#define KEYPAD_COLUMNS 20u
#endif

/* Silence inside a message after which it is given up, in milliseconds. */
#ifndef KEYPAD_PATIENCE
#define KEYPAD_PATIENCE 500u
#endif

/* Time between two looks at the keys, in milliseconds. A key counts when two looks agree. */
#ifndef KEYPAD_DEBOUNCE
#define KEYPAD_DEBOUNCE 10u
#endif

/* Bytes of own messages that can wait; a key press takes 3. */
#ifndef KEYPAD_QUEUE
#define KEYPAD_QUEUE 192u
#endif

/* Answers variables that a keypad does not have, for tests and service: see diagnostics.h. */
#ifndef KEYPAD_DIAGNOSTICS
#define KEYPAD_DIAGNOSTICS 0
#endif

#endif
