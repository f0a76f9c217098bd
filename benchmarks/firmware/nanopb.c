/* core.c with MESSAGE: nanopb makes the payload, and the generated header the frame. */
#include <pb_decode.h>
#include <pb_encode.h>

#include "motion.pb.h"
#include "qlink.h"

volatile uint8_t port;

void send(const uint8_t *bytes, int size);
__attribute__((noinline)) void send(const uint8_t *bytes, int size)
{
    while (size-- > 0) {
        port = *bytes++;
    }
}

static qlink_receiver_t receiver;
static uint8_t wire[QLINK_MAX_WIRE_SIZE];

static void answer(const qlink_frame_t *frame)
{
    uint8_t payload[MotionResponse_size];
    MotionResponse message = MotionResponse_init_zero;
    pb_istream_t input = pb_istream_from_buffer(frame->payload, frame->size);
    pb_ostream_t output = pb_ostream_from_buffer(payload, sizeof payload);
    if (pb_decode(&input, MotionResponse_fields, &message)) {
        message.counter++;
        if (pb_encode(&output, MotionResponse_fields, &message)) {
            send(wire, qlink_frame_encode(frame->id, frame->node, payload, output.bytes_written, wire, sizeof wire));
        }
    }
}

int main(void)
{
    qlink_receiver_init(&receiver);
    for (;;) {
        if (qlink_receive(&receiver, port) == QLINK_EVENT_FRAME) {
            const qlink_frame_t frame = qlink_receiver_frame(&receiver);
            answer(&frame);
        }
    }
}
