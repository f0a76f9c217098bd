/*
 * Diagnostics over the ring itself, for tests and service. A keypad ignores variables. With KEYPAD_DIAGNOSTICS it
 * answers some that no Motion Coordinator has (16000 and above), also before it has its offset. Only for builds with
 * -DKEYPAD_DIAGNOSTICS=1; do not ship them.
 *
 * Number of the variable: DIAGNOSTICS_FIRST + 16 * operation + address; the answer is sent that many nodes along the
 * ring. The value is an integer, the operand.
 *
 *   operation            operand     answer
 *   0 press              key, 0-63   none; the same as if the key were pressed
 *   1 release            key, 0-63   none
 *   2 inputs             24 bits     none; from now on these replace the pins of the keys
 *   3 row                0-3         the characters of the row
 *   4 look               0-16        variable `operand` gets the value: 0 offset, 1 mode, 2 place of the cursor,
 *                                    3 cursor visible, 4 display.ignored, 5 taken, 6 passed, 7 blocked, 8 cut_short,
 *                                    9 frame_faults, 10 crc_faults, 11 early_keys, 12 early_messages, 13 lost_keys,
 *                                    14 ignored, 15 board_overruns, 16 seconds since the start
 *   5 restart            none        none; power off and on, clears the counters too
 *
 * Diagnostics are not counted. A number outside this table is a variable like any other.
 */
#ifndef DIAGNOSTICS_H
#define DIAGNOSTICS_H

#include "keypad.h"

#define DIAGNOSTICS_FIRST 16000u

/* Runs the operation of a variable; false if it is not a diagnostic one. */
bool diagnostics_take(keypad_t *keypad, const trio_direct_variable_transfer_t *message);

/* The keys that are down: those of the board, unless a diagnostic has set them. */
uint32_t diagnostics_inputs(uint32_t pins);

#endif
