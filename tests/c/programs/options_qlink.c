/* A slave of Q.link as firmware builds one: interrupt and main loop apart, handlers in flash, commands left out. */
#include <stdio.h>
#include <string.h>

#define QLINK_WITHOUT_READ
#define QLINK_WITHOUT_NODE_SYNC
#define QLINK_ENABLE_FLOAT 1
#define QLINK_REAL float
#include "qlink.h"

#define CHECK(condition) \
    do { \
        if (!(condition)) { \
            printf("%d: %s\n", __LINE__, #condition); \
            return 1; \
        } \
    } while (0)

#if QLINK_SCHEMA_HASH == 0 /* for the preprocessor too */
#error "no hash"
#endif

static int motions;

static bool on_motion(qlink_slave_t *slave, const qlink_motion_request_t *request, qlink_motion_response_t *response)
{
    (void)slave;
    ++motions;
    response->counter = request->counter;
    return true;
}

#if QLINK_CONST_HANDLERS
static const qlink_slave_handlers_t handlers QLINK_HANDLERS_STORAGE = { .motion = on_motion };
static qlink_slave_t slave = { .node = 3U, .handlers = &handlers };
#else
static qlink_slave_t slave = { .node = 3U, .motion = on_motion };
#endif

static qlink_receiver_t receiver;
static qlink_event_counts_t counts;
static qlink_inbox_t inbox;
static qlink_outbox_t outbox;

/* What DMA has stored. */
static size_t received(const uint8_t *bytes, size_t size)
{
    size_t at = 0U, frames = 0U;
    while (at < size) {
        qlink_event_t event;
        qlink_frame_t frame;
        at += qlink_receive_bytes(&receiver, &bytes[at], size - at, &event);
        qlink_count_event(&counts, event);
        if (event == QLINK_EVENT_FRAME) {
            qlink_receiver_read(&receiver, &frame);
            frames += qlink_inbox_put(&inbox, &frame) ? 1U : 0U;
        }
    }
    return frames;
}

int main(void)
{
    static const qlink_motion_request_t request = QLINK_MOTION_REQUEST_INIT;
    static const qlink_read_request_t unknown = QLINK_READ_REQUEST_INIT;
    uint8_t wire[4U * QLINK_MAX_WIRE_SIZE], sent[QLINK_MAX_WIRE_SIZE], byte;
    size_t size, single, count = 0U;
    const qlink_frame_t *frame;
    qlink_tenths_t raw;

    CHECK(strcmp(QLINK_SCHEMA_REVISION, "1.0") == 0);
    qlink_receiver_init(&receiver);
    single = (size_t)qlink_motion_request_to_frame(&request, 3U, wire, sizeof wire);
    size = single;
    memcpy(&wire[size], wire, single); /* a second one, which the main loop has no time for */
    size += single;
    memcpy(&wire[size], wire, single);
    wire[size + single - 1U] ^= 1U;
    size += single;

    CHECK(qlink_inbox_frame(&inbox) == NULL);
    CHECK(received(wire, size) == 1U);
    CHECK((counts.of[QLINK_EVENT_FRAME] == 2U) && (counts.of[QLINK_EVENT_CRC] == 1U));
    CHECK(counts.of[QLINK_EVENT_NONE] == 0U);
    memset(&receiver, 0, sizeof receiver); /* the receiver is used again before the frame is handled */

    frame = qlink_inbox_frame(&inbox);
    CHECK((frame != NULL) && (frame->node == 3U));
    size = qlink_slave_dispatch(&slave, frame, outbox.wire, sizeof outbox.wire);
    CHECK((motions == 1) && (size > 0U));
    qlink_inbox_clear(&inbox);
    CHECK(qlink_inbox_frame(&inbox) == NULL);

    CHECK(!qlink_outbox_next(&outbox, &byte));
    qlink_outbox_start(&outbox, size);
    while (qlink_outbox_next(&outbox, &byte)) {
        CHECK(count < sizeof sent);
        sent[count] = byte;
        ++count;
    }
    CHECK((count == size) && (memcmp(sent, outbox.wire, size) == 0) && !outbox.busy);
    qlink_outbox_start(&outbox, 0U);
    CHECK(!outbox.busy && !qlink_outbox_next(&outbox, &byte));

    /* A command that is left out is not answered. */
    size = (size_t)qlink_read_request_to_frame(&unknown, 3U, wire, sizeof wire);
    qlink_receiver_init(&receiver);
    CHECK(received(wire, size) == 1U);
    CHECK(qlink_slave_dispatch(&slave, qlink_inbox_frame(&inbox), outbox.wire, sizeof outbox.wire) == 0U);

    CHECK(sizeof(qlink_tenths_physical(1U)) == sizeof(float));
    for (unsigned value = 0U; value < 256U; ++value) {
        CHECK((qlink_tenths_raw(qlink_tenths_physical((uint8_t)value), &raw) == QLINK_OK) && (raw == value));
    }
    CHECK(qlink_tenths_raw(25.6F, &raw) == QLINK_ERROR_RANGE);
    return 0;
}
