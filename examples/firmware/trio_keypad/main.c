/* A membrane keypad of the Trio network. One UART for both sides: it receives from the previous node and sends to the
 * next one. */
#include "board.h"
#include "diagnostics.h"
#include "keypad.h"

static keypad_t keypad;

static void receive_waiting(uint32_t now)
{
    uint8_t byte;
    while (ring_has_room(&keypad.ring) && board_receive(&byte)) {
        ring_receive(&keypad.ring, byte, now);
    }
}

static uint32_t key_lines(void)
{
#if KEYPAD_DIAGNOSTICS
    return diagnostics_inputs(board_inputs());
#else
    return board_inputs();
#endif
}

int main(void)
{
    keypad_start(&keypad);
    board_start();
    for (;;) {
        const uint32_t now = board_milliseconds();
        receive_waiting(now);
        ring_poll(&keypad.ring, now);
        keypad_look(&keypad, key_lines(), now);
        /* A product copies keypad.display.cells to its display here. */
        if (!ring_transmit(&keypad.ring)) {
            board_wait();
        }
    }
}
