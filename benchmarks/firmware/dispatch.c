/* A slave without a device: bytes in, requests to the functions of the dispatch table, answers out. */
#include "qlink.h"

volatile uint8_t port;

void send(const uint8_t *bytes, size_t size);
__attribute__((noinline)) void send(const uint8_t *bytes, size_t size)
{
    while (size-- > 0u) {
        port = *bytes++;
    }
}

qlink_slave_t slave; /* defined by the program that links this */
static qlink_receiver_t receiver;
static uint8_t wire[QLINK_MAX_WIRE_SIZE];

int main(void)
{
    qlink_receiver_init(&receiver);
    for (;;) {
        if (qlink_receive(&receiver, port) == QLINK_EVENT_FRAME) {
            const qlink_frame_t frame = qlink_receiver_frame(&receiver);
            send(wire, qlink_slave_dispatch(&slave, &frame, wire, sizeof wire));
        }
    }
}
