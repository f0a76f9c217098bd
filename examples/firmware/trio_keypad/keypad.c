#include "keypad.h"

#include <string.h>

#include "diagnostics.h"

#define KEY_UP 64u /* in mode ON_OFF a released key sends its number plus this */
#define INPUTS 24u

/* Whether a message may have an effect now. */
static bool is_told(keypad_t *keypad)
{
    if (keypad->offset == 0u) {
        ++keypad->early_messages;
    }
    return keypad->offset != 0u;
}

static void on_characters(trio_listener_t *listener, uint8_t address, const trio_character_transfer_t *message)
{
    keypad_t *const keypad = listener->context;
    (void)address;
    if (is_told(keypad)) {
        display_feed(&keypad->display, message->characters, message->characters_size);
    }
}

static void on_variable(trio_listener_t *listener, uint8_t address, const trio_direct_variable_transfer_t *message)
{
    keypad_t *const keypad = listener->context;
    (void)address;
#if KEYPAD_DIAGNOSTICS
    if (diagnostics_take(keypad, message)) {
        return;
    }
#else
    (void)message;
#endif
    if (is_told(keypad)) {
        ++keypad->ignored;
    }
}

static void on_offset(trio_listener_t *listener, uint8_t address, const trio_keypad_offset_t *message)
{
    keypad_t *const keypad = listener->context;
    (void)address;
    keypad->offset = message->offset;
    keypad->ring.passes = true;
}

static void on_mode(trio_listener_t *listener, uint8_t address, const trio_keypad_mode_message_t *message)
{
    keypad_t *const keypad = listener->context;
    (void)address;
    if (!is_told(keypad)) {
        return;
    }
    if (trio_keypad_mode_is_valid(message->mode)) {
        keypad->mode = message->mode;
    } else {
        ++keypad->ignored;
    }
}

void keypad_start(keypad_t *keypad)
{
    memset(keypad, 0, sizeof *keypad);
    keypad->listener.context = keypad;
    keypad->listener.character_transfer = on_characters;
    keypad->listener.direct_variable_transfer = on_variable;
    keypad->listener.keypad_offset = on_offset;
    keypad->listener.keypad_mode_message = on_mode;
    keypad->mode = TRIO_KEYPAD_MODE_ON_ONLY;
    ring_start(&keypad->ring, &keypad->listener);
    display_start(&keypad->display);
}

static void send_key(keypad_t *keypad, uint8_t character)
{
    uint8_t frame[TRIO_MAX_FRAME_SIZE - TRIO_MAX_PAYLOAD_SIZE + 1u];
    trio_character_transfer_t message;
    int size;
    if (keypad->offset == 0u) {
        ++keypad->early_keys;
        return;
    }
    message.characters_size = 1u;
    message.characters[0] = character;
    size = trio_character_transfer_to_frame(&message, keypad->offset, frame, sizeof frame);
    if (size < 0 || !ring_send(&keypad->ring, frame, (size_t)size)) {
        ++keypad->lost_keys;
    }
}

void keypad_press(keypad_t *keypad, uint8_t key)
{
    send_key(keypad, key);
}

void keypad_release(keypad_t *keypad, uint8_t key)
{
    if (keypad->mode == TRIO_KEYPAD_MODE_ON_OFF) {
        send_key(keypad, (uint8_t)(key + KEY_UP));
    }
}

/* The keys that have changed, debounced: two scans agree. */
static uint32_t changes(keypad_t *keypad, uint32_t inputs)
{
    const uint32_t agreed = ~(inputs ^ keypad->seen);
    if (!keypad->watching) {
        keypad->down = inputs;
        keypad->watching = true;
    }
    keypad->seen = inputs;
    return (inputs ^ keypad->down) & agreed;
}

void keypad_look(keypad_t *keypad, uint32_t inputs, uint32_t now)
{
    uint32_t changed;
    if (keypad->watching && (uint32_t)(now - keypad->looked) < KEYPAD_DEBOUNCE) {
        return;
    }
    keypad->looked = now;
    changed = changes(keypad, inputs);
    keypad->down ^= changed;
    for (uint8_t key = 0u; key < INPUTS; ++key) {
        const uint32_t bit = (uint32_t)1u << key;
        if ((changed & bit & inputs) != 0u) {
            keypad_press(keypad, key);
        } else if ((changed & bit) != 0u) {
            keypad_release(keypad, key);
        } else {
            /* as it was */
        }
    }
}
