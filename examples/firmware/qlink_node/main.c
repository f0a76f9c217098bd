/* The main loop: bytes, time, answers. */
#include "board.h"
#include "line.h"
#include "node.h"

/* Time of a byte on the line in whole milliseconds, plus one because the first tick may be near. */
#define BYTE_MS (QLINK_BITS_PER_BYTE * 1000ul / BOARD_BAUD + 2u)

static node_t node;
static uint8_t answer[QLINK_MAX_WIRE_SIZE];

static bool receive_within(uint8_t *byte, uint32_t milliseconds)
{
    const uint32_t begin = board_milliseconds();
    while (!board_receive(byte)) {
        if (board_milliseconds() - begin >= milliseconds) {
            return false;
        }
        board_wait();
    }
    return true;
}

/* A frame is complete with its check value. The master may still send a byte inserted after it: the answer waits for
 * that byte. */
static void wait_for_inserted(void)
{
    uint8_t byte;
    if (qlink_receiver_pending(&node.receiver) && receive_within(&byte, BYTE_MS)) {
        (void)node_receive(&node, byte); /* a single byte completes no frame */
    }
}

#if BOARD_HEARS_ITSELF
/* The next bytes are the echo of the answer, and some answers look like requests. A different byte or silence ends the
 * echo; the bytes after it go to the receiver. */
static void drop_echo(size_t size)
{
    size_t index;
    uint8_t byte;
    for (index = 0u; index < size && receive_within(&byte, BYTE_MS + 1u); ++index) {
        if (byte != answer[index]) {
            qlink_receiver_init(&node.receiver);
            (void)node_receive(&node, byte);
            return;
        }
    }
}
#endif

static void send_answer(size_t size)
{
    wait_for_inserted();
    board_send(answer, size);
#if BOARD_HEARS_ITSELF
    drop_echo(size);
#endif
    node_sent(&node);
}

static void advance(uint32_t now)
{
    node_advance(&node, board_inputs(), now);
    board_outputs(node.io.outputs);
}

/* The answer has to begin within three byte times, so the time is not updated once more before it, unless so many bytes
 * were received at once that ticks were missed. */
static void answer_frame(void)
{
    const uint32_t now = board_milliseconds();
    size_t size;
    if (now - node.now > 1u) {
        advance(now);
    }
    size = node_answer(&node, answer);
    board_outputs(node.io.outputs);
    if (size > 0u) {
        send_answer(size);
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
            answer_frame();
        } else {
            /* the frame is not complete */
        }
    }
}
