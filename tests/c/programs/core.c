/* Receive, decode, change, encode, send: what one message costs; without CORE, the program around it. */
#include "qlink.h"
volatile uint8_t port;
void send(const uint8_t *bytes, int size);
__attribute__((noinline)) void send(const uint8_t *bytes, int size) { while (size-- > 0) { port = *bytes++; } }
#ifdef CORE
static qlink_receiver_t receiver;
static uint8_t wire[QLINK_MOTION_RESPONSE_MAX_WIRE_SIZE];
int main(void)
{
    qlink_receiver_init(&receiver);
    for (;;) {
        if (qlink_receive(&receiver, port) == QLINK_EVENT_FRAME) {
            const qlink_frame_t frame = qlink_receiver_frame(&receiver);
            qlink_motion_response_t message;
            if (qlink_motion_response_decode(&message, frame.payload, frame.size) == QLINK_OK) {
                message.counter++;
                send(wire, qlink_motion_response_to_frame(&message, frame.node, wire, sizeof wire));
            }
        }
    }
}
#else
int main(void) { for (;;) { send((const uint8_t *)0x100, port); } }
#endif
