#include "diagnostics.h"

#if KEYPAD_DIAGNOSTICS

#include <string.h>

#include "board.h"

#define OPERATION 16u /* variable numbers per operation, one for each address */
#define OVERHEAD 4u  /* bytes of a frame beyond its payload, check value included */

typedef enum operation { PRESS, RELEASE, INPUTS, ROW, LOOK, RESTART } operation_t;

static bool inputs_given;
static uint32_t inputs;

static bool find(const keypad_t *keypad, uint32_t what, uint32_t *value)
{
    const uint32_t values[] = {
        keypad->offset,
        keypad->mode,
        keypad->display.place,
        keypad->display.cursor_visible ? 1u : 0u,
        keypad->display.ignored,
        keypad->ring.taken,
        keypad->ring.passed,
        keypad->ring.blocked,
        keypad->ring.cut_short,
        keypad->ring.frame_faults,
        keypad->ring.crc_faults,
        keypad->early_keys,
        keypad->early_messages,
        keypad->lost_keys,
        keypad->ignored,
        board_overruns(),
        board_milliseconds() / 1000u,
    };
    if (what >= sizeof values / sizeof values[0]) {
        return false;
    }
    *value = values[what];
    return true;
}

static void look(keypad_t *keypad, uint32_t what, uint8_t address)
{
    uint8_t frame[TRIO_DIRECT_VARIABLE_TRANSFER_MAX_SIZE + OVERHEAD];
    trio_direct_variable_transfer_t answer;
    uint32_t value = 0u;
    int size;
    if (!find(keypad, what, &value)) {
        return;
    }
    answer.number = (uint16_t)what;
    answer.value = (int64_t)((uint64_t)value << 32);
    size = trio_direct_variable_transfer_to_frame(&answer, address, frame, sizeof frame);
    if (size > 0) {
        (void)ring_send(&keypad->ring, frame, (size_t)size);
    }
}

static void tell_row(keypad_t *keypad, uint32_t row, uint8_t address)
{
    uint8_t frame[KEYPAD_COLUMNS + OVERHEAD];
    trio_character_transfer_t answer;
    int size;
    if (row >= KEYPAD_ROWS) {
        return;
    }
    answer.characters_size = KEYPAD_COLUMNS;
    memcpy(answer.characters, keypad->display.cells + row * KEYPAD_COLUMNS, KEYPAD_COLUMNS);
    size = trio_character_transfer_to_frame(&answer, address, frame, sizeof frame);
    if (size > 0) {
        (void)ring_send(&keypad->ring, frame, (size_t)size);
    }
}

static void set_inputs(uint32_t lines)
{
    inputs = lines;
    inputs_given = true;
}

static void perform(keypad_t *keypad, operation_t operation, uint32_t operand, uint8_t address)
{
    switch (operation) {
    case PRESS:
        keypad_press(keypad, (uint8_t)(operand % KEYPAD_KEYS));
        break;
    case RELEASE:
        keypad_release(keypad, (uint8_t)(operand % KEYPAD_KEYS));
        break;
    case INPUTS:
        set_inputs(operand);
        break;
    case ROW:
        tell_row(keypad, operand, address);
        break;
    case LOOK:
        look(keypad, operand, address);
        break;
    case RESTART:
    default:
        inputs_given = false;
        keypad_start(keypad);
        break;
    }
}

bool diagnostics_take(keypad_t *keypad, const trio_direct_variable_transfer_t *message)
{
    const unsigned code = (unsigned)message->number - DIAGNOSTICS_FIRST;
    const unsigned operation = code / OPERATION;
    if (message->number < DIAGNOSTICS_FIRST || operation > (unsigned)RESTART) {
        return false;
    }
    perform(keypad, (operation_t)operation, (uint32_t)((uint64_t)message->value >> 32), (uint8_t)(code % OPERATION));
    --keypad->ring.taken; /* the message is about to be counted */
    return true;
}

uint32_t diagnostics_inputs(uint32_t pins)
{
    return inputs_given ? inputs : pins;
}

#else

typedef int diagnostics_are_left_out; /* ISO C forbids an empty translation unit */

#endif
