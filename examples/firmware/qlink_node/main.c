/* The main loop: bytes, time, answers. */
#include "board.h"
#include "line.h"
#include "node.h"

/* A byte on the line in whole milliseconds, and one more because the first tick may be near. */
#define BYTE_MS (QLINK_BITS_PER_BYTE * 1000ul / BOARD_BAUD + 2u)

static node_t node;
static uint8_t answer[QLINK_MAX_WIRE_SIZE];

/* A frame is complete with its check value. If that ends with the byte of the preamble, one more is inserted behind
 * it, and whoever asks is still sending: the answer waits for that byte. */
static void wait_for_inserted(void)
{
    const uint32_t begin = board_milliseconds();
    uint8_t byte;
    while (!board_receive(&byte)) {
        if (board_milliseconds() - begin >= BYTE_MS) {
            return;
        }
        board_wait();
    }
    (void)node_receive(&node, byte); /* a single byte completes no frame */
}

static void advance(uint32_t now)
{
    node_advance(&node, board_inputs(), now);
    board_outputs(node.io.outputs);
}

/* The answer has to begin within three byte times. So time is not worked out once more in front of it, unless so many
 * bytes came at once that ticks were missed. */
static void answer_frame(uint8_t last)
{
    const uint32_t now = board_milliseconds();
    size_t size;
    if (now - node.now > 1u) {
        advance(now);
    }
    size = node_answer(&node, answer);
    board_outputs(node.io.outputs);
    if (size > 0u) {
        if (last == answer[0]) {
            wait_for_inserted();
        }
        board_send(answer, size);
    }
}

int main(void)
{
    uint8_t byte;
    board_start();
    node_init(&node, board_inputs(), board_milliseconds());
    for (;;) {
        if (!board_receive(&byte)) {
            advance(board_milliseconds());
            board_wait();
        } else if (node_receive(&node, byte)) {
            answer_frame(byte);
        } else {
            /* more is to come */
        }
    }
}
