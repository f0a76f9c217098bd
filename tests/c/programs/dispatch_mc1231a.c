#include "mc1231a.h"
#include <assert.h>
static bool on_position(mc1231a_slave_t *s, const mc1231a_set_pos_request_t *q) { (void)s; return q->value == -5; }
static bool on_status(mc1231a_slave_t *s, mc1231a_set_1_response_t *r) { (void)s; r->status = 0x0105u; return true; }
static mc1231a_slave_t slave;
static mc1231a_receiver_t receiver;
static uint8_t answer[MC1231A_MAX_WIRE_SIZE];
static size_t asked(const uint8_t *wire, int size)
{
    mc1231a_event_t event = MC1231A_EVENT_NONE;
    mc1231a_frame_t frame;
    for (int index = 0; index < size; ++index) { event = mc1231a_receive(&receiver, wire[index]); }
    assert(event == MC1231A_EVENT_FRAME);
    frame = mc1231a_receiver_frame(&receiver);
    return mc1231a_slave_dispatch(&slave, &frame, answer, sizeof answer);
}
int main(void)
{
    uint8_t wire[MC1231A_MAX_WIRE_SIZE];
    mc1231a_set_pos_request_t position = { -5 };
    mc1231a_set_1_response_t status;
    int size;
    size_t got;
    mc1231a_receiver_init(&receiver);
    slave.set_pos = on_position;
    slave.set_1 = on_status;
    size = mc1231a_set_pos_request_to_frame(&position, wire, sizeof wire);
    got = asked(wire, size);
    assert(mc1231a_set_pos_response_from_frame(mc1231a_request_sum(wire, (size_t)size), answer, got) == MC1231A_OK);
    answer[1] ^= 1u;
    assert(mc1231a_set_pos_response_from_frame(mc1231a_request_sum(wire, (size_t)size), answer, got) == MC1231A_ERROR_CRC);
    size = mc1231a_set_1_request_to_frame(wire, sizeof wire);
    got = asked(wire, size);
    assert(mc1231a_set_1_response_from_frame(&status, mc1231a_request_sum(wire, (size_t)size), answer, got) == MC1231A_OK);
    assert(status.status == 0x0105u);
    /* a command without a function is refused in the same way as by the chip */
    slave.set_1 = NULL;
    got = asked(wire, size);
    assert(mc1231a_set_1_response_from_frame(&status, mc1231a_request_sum(wire, (size_t)size), answer, got) == MC1231A_ERROR_ILLEGAL);
    assert(mc1231a_receive(&receiver, 0xFFu) == MC1231A_EVENT_UNKNOWN);
    return 0;
}
