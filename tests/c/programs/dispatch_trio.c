#include "trio.h"
#include <assert.h>
static int heard;
static void on_mode(trio_listener_t *l, uint8_t address, const trio_keypad_mode_message_t *m) { (void)l; heard = address * 1000 + m->mode; }
int main(void)
{
    uint8_t wire[TRIO_MAX_WIRE_SIZE];
    trio_keypad_mode_message_t mode = { TRIO_KEYPAD_MODE_ON_OFF };
    static trio_listener_t listener;
    trio_frame_t frame;
    const int size = trio_keypad_mode_message_to_frame(&mode, 15u, wire, sizeof wire);
    listener.keypad_mode_message = on_mode;
    assert(size == 3 && trio_frame_decode(&frame, wire, 3u) == TRIO_OK);
    assert(trio_listener_dispatch(&listener, &frame) == TRIO_OK && heard == 15127);
    assert(trio_keypad_mode_message_to_frame(&mode, 0u, wire, sizeof wire) == TRIO_ERROR_RANGE);
    return 0;
}
