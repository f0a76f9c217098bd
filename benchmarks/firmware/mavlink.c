/* core.c with MESSAGE, in MAVLink, which has its own frame, check value and address. */
#include "motion/mavlink.h"

volatile uint8_t port;

void send(const uint8_t *bytes, int size);
__attribute__((noinline)) void send(const uint8_t *bytes, int size)
{
    while (size-- > 0) {
        port = *bytes++;
    }
}

static mavlink_message_t frame;
static mavlink_status_t status;
static uint8_t wire[MAVLINK_NUM_NON_PAYLOAD_BYTES + MAVLINK_MSG_ID_MOTION_RESPONSE_LEN];

int main(void)
{
    for (;;) {
        if (mavlink_parse_char(MAVLINK_COMM_0, port, &frame, &status) == MAVLINK_FRAMING_OK &&
            frame.msgid == MAVLINK_MSG_ID_MOTION_RESPONSE) {
            mavlink_motion_response_t message;
            mavlink_msg_motion_response_decode(&frame, &message);
            message.counter++;
            mavlink_msg_motion_response_encode(frame.sysid, frame.compid, &frame, &message);
            send(wire, mavlink_msg_to_send_buffer(wire, &frame));
        }
    }
}
