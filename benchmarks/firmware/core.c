/* Receive, change, encode, send: the cost of a header. EMPTY: the program without it. MESSAGE: a motion response is
 * decoded, changed and encoded again, as in the hand-written floors and the peers. ANSWER: any frame is answered by one
 * without data. PAYLOAD: any frame is sent back with its payload. */
#include "qlink.h"

#if defined(MESSAGE)
#define WIRE_SIZE QLINK_MOTION_RESPONSE_MAX_WIRE_SIZE
#else
#define WIRE_SIZE QLINK_MAX_WIRE_SIZE
#endif

volatile uint8_t port;

void send(const uint8_t *bytes, int size);
__attribute__((noinline)) void send(const uint8_t *bytes, int size)
{
    while (size-- > 0) {
        port = *bytes++;
    }
}

#if defined(EMPTY)
int main(void)
{
    for (;;) {
        send((const uint8_t *)0x100, port);
    }
}
#else
static qlink_receiver_t receiver;
static uint8_t wire[WIRE_SIZE];

int main(void)
{
    qlink_receiver_init(&receiver);
    for (;;) {
        if (qlink_receive(&receiver, port) == QLINK_EVENT_FRAME) {
            const qlink_frame_t frame = qlink_receiver_frame(&receiver);
#if defined(MESSAGE)
            qlink_motion_response_t message;
            if (qlink_motion_response_decode(&message, frame.payload, frame.size) == QLINK_OK) {
                message.counter++;
                send(wire, qlink_motion_response_to_frame(&message, frame.node, wire, sizeof wire));
            }
#elif defined(ANSWER)
            send(wire, qlink_clear_fifo_response_to_frame(frame.node, wire, sizeof wire));
#elif defined(PAYLOAD)
            send(wire, qlink_frame_encode(frame.id, frame.node, frame.payload, frame.size, wire, sizeof wire));
#endif
        }
    }
}
#endif
