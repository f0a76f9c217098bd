#include "qlink.h"
#include <assert.h>
static int started, synced, motions, responses;
static bool on_motion(qlink_slave_t *s, const qlink_motion_request_t *q, qlink_motion_response_t *r)
{
    (void)s; ++motions; r->counter = q->counter; r->fifo_space = q->segments_count; return q->outputs != 0xFFu;
}
static bool on_setup(qlink_slave_t *s, const qlink_node_setup_request_t *q) { s->node = q->node_number; return true; }
static void on_start(qlink_slave_t *s) { started += s->broadcast ? 100 : 1; }
static void on_sync(qlink_slave_t *s, const qlink_node_sync_request_t *q) { (void)s; synced = q->counter; }
static void on_response(qlink_master_t *m, uint8_t node, const qlink_motion_response_t *r)
{
    (void)m; responses = node * 100 + r->fifo_space;
}
static qlink_slave_t slave;
static uint8_t answer[QLINK_MAX_WIRE_SIZE];
static qlink_frame_t frame;
static size_t asked(int size, const uint8_t *wire)
{
    static uint8_t body[QLINK_DECODE_BUFFER_SIZE];
    assert(size > 0);
    assert(qlink_frame_decode(&frame, body, wire, (size_t)size) == QLINK_OK);
    return qlink_slave_dispatch(&slave, &frame, answer, sizeof answer);
}
int main(void)
{
    uint8_t wire[QLINK_MAX_WIRE_SIZE];
    uint8_t body[QLINK_DECODE_BUFFER_SIZE];
    qlink_motion_request_t motion = QLINK_MOTION_REQUEST_INIT;
    qlink_node_setup_request_t setup = QLINK_NODE_SETUP_REQUEST_INIT;
    qlink_node_sync_request_t sync = { 9u };
    static qlink_master_t master;
    qlink_frame_t reply;
    size_t size;
    const uint8_t bad[4] = { 17u, 0u, 0u, 0u };
    slave.node = 3u;
    /* no function for the command */
    assert(asked(qlink_motion_request_to_frame(&motion, 3u, wire, sizeof wire), wire) == 0u);
    slave.motion = on_motion; slave.node_setup = on_setup; slave.node_start = on_start; slave.node_sync = on_sync;
    /* answered, and understood by the master */
    motion.counter = 7u; motion.segments_count = 2u;
    size = asked(qlink_motion_request_to_frame(&motion, 3u, wire, sizeof wire), wire);
    assert(size > 0u && motions == 1);
    assert(qlink_frame_decode(&reply, body, answer, size) == QLINK_OK && reply.node == 3u);
    master.motion = on_response;
    assert(qlink_master_dispatch(&master, &reply) == QLINK_OK && responses == 302);
    /* a response comes neither from the broadcast address nor from an invalid node; its own errors come first */
    responses = 0;
    for (unsigned node = 0u; node <= 255u; ++node) {
        reply.node = (uint8_t)node;
        assert(qlink_master_dispatch(&master, &reply) == qlink_response_check(&reply));
        assert(qlink_response_check(&reply) == ((node >= 1u && node <= 16u) ? QLINK_OK : QLINK_ERROR_RANGE));
    }
    assert(responses == 1602);
    --reply.size;
    assert(qlink_master_dispatch(&master, &reply) == QLINK_ERROR_LENGTH && responses == 1602);
    /* another node; a function that refuses */
    assert(asked(qlink_motion_request_to_frame(&motion, 4u, wire, sizeof wire), wire) == 0u && motions == 1);
    motion.outputs = 0xFFu;
    assert(asked(qlink_motion_request_to_frame(&motion, 3u, wire, sizeof wire), wire) == 0u && motions == 2);
    /* one node or all nodes; only all nodes */
    assert(asked(qlink_node_start_request_to_frame(3u, wire, sizeof wire), wire) == 0u && started == 1);
    assert(asked(qlink_node_start_request_to_frame(0u, wire, sizeof wire), wire) == 0u && started == 101);
    assert(asked(qlink_node_sync_request_to_frame(&sync, 0u, wire, sizeof wire), wire) == 0u && synced == 9);
    assert(qlink_node_sync_request_to_frame(&sync, 3u, wire, sizeof wire) == QLINK_ERROR_RANGE);
    assert(qlink_motion_request_to_frame(&motion, 0u, wire, sizeof wire) == QLINK_ERROR_RANGE);
    /* a broadcast of a command that may not be broadcast is not handled */
    assert(asked(qlink_frame_encode(QLINK_MOTION_REQUEST_ID, 0u, bad, 2u, wire, sizeof wire), wire) == 0u && motions == 2);
    /* invalid values, invalid sizes and unknown commands reach no function */
    assert(asked(qlink_frame_encode(QLINK_NODE_SETUP_REQUEST_ID, 3u, bad, 4u, wire, sizeof wire), wire) == 0u && slave.node == 3u);
    assert(asked(qlink_frame_encode(QLINK_MOTION_REQUEST_ID, 3u, bad, 1u, wire, sizeof wire), wire) == 0u && motions == 2);
    assert(asked(qlink_frame_encode(0x77u, 3u, bad, 4u, wire, sizeof wire), wire) == 0u);
    assert(qlink_request_check(&frame) == QLINK_ERROR_UNKNOWN);
    /* an answered broadcast; the answer carries the new number */
    setup.node_number = 5u;
    size = asked(qlink_node_setup_request_to_frame(&setup, 0u, wire, sizeof wire), wire);
    assert(size > 0u && qlink_frame_decode(&reply, body, answer, size) == QLINK_OK && reply.node == 5u);
    /* each capacity that is too small is reported, and one that suffices is accepted */
    motion.counter = 0xA5u; motion.segments[0] = 0xA5A5u; motion.segments[1] = 0xA5A5u;
    {
        const int whole = qlink_motion_request_to_frame(&motion, 3u, wire, sizeof wire);
        assert(whole == 7 + 6 + 5);
        for (size_t room = 0u; room <= (size_t)whole; ++room) {
            uint8_t *const exact = (uint8_t *)__builtin_alloca(room + 1u);
            const int got = qlink_motion_request_to_frame(&motion, 3u, exact, room);
            assert(got == (room < (size_t)whole ? (int)QLINK_ERROR_CAPACITY : whole));
        }
    }
    /* an empty request is decoded as its defaults */
    {
        qlink_node_program_load_request_t load = { 9u, 1u, { 0u } };
        assert(qlink_node_program_load_request_decode(&load, bad, 0u) == QLINK_OK && load.counter == 0u && load.program_data_size == 0u);
    }
    assert(QLINK_RESPONSE_US(MOTION, 115200ul) == 261ul && QLINK_RESPONSE_US(NODE_PROGRAM_LOAD, 115200ul) == 10000ul);
    assert(QLINK_NODE_START_ANSWERED == 0 && QLINK_MOTION_ANSWERED == 1);
    assert(QLINK_MOTION_REPEAT == QLINK_REPEAT_BY_COUNTER && QLINK_NODE_PROGRAM_LOAD_REPEAT == QLINK_REPEAT_BY_COUNTER);
    assert(QLINK_MOTOR_REQUEST_REPEAT == QLINK_REPEAT_UNSAFE && QLINK_NODE_START_REPEAT == QLINK_REPEAT_SAFE);
    assert(QLINK_MOTION_ADDRESSING == QLINK_ADDRESSING_NODE && QLINK_NODE_START_ADDRESSING == QLINK_ADDRESSING_EITHER);
    assert(QLINK_NODE_SYNC_ADDRESSING == QLINK_ADDRESSING_BROADCAST);
    assert(QLINK_NODE_SETUP_ADDRESSING == QLINK_ADDRESSING_ANSWERED_BROADCAST);
#if defined(QLINK_NODE_START_RESPONSE_BITS) || defined(QLINK_NODE_SYNC_RESPONSE_US)
#error "what is not answered has no time to answer in"
#endif
    return 0;
}
