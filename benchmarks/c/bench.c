/*
 * Times the generated header and hand.h on the same messages, in turns.
 * Prints a line of names, then a line of nanoseconds per frame for each round.
 */
#define _POSIX_C_SOURCE 199309L
#define QLINK_CRC_FORM QLINK_CRC_FORM_TABLE
#include "qlink.h"

#include "hand.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MESSAGES = 256, PASSES = 16, ROOM = 64 };

static hand_response hand_messages[MESSAGES];
static qlink_motion_response_t messages[MESSAGES];
static uint8_t wires[MESSAGES][ROOM];
static size_t sizes[MESSAGES];
static size_t capacity = ROOM; /* volatile: both sides check it at run time */
static unsigned sink;

/* Not inlined: the arguments are unknown to the compiler. */
#define CALL static __attribute__((noinline))

CALL int call_hand_encode(const hand_response *message, uint8_t *wire, size_t room)
{
    return hand_encode(message, wire, room);
}

CALL int call_encode(const qlink_motion_response_t *message, uint8_t node, uint8_t *wire, size_t room)
{
    return qlink_motion_response_to_frame(message, node, wire, room);
}

CALL int call_hand_decode(hand_response *message, const uint8_t *wire, size_t size)
{
    return hand_decode(message, wire, size);
}

CALL int call_decode(qlink_motion_response_t *message, uint8_t *node, const uint8_t *wire, size_t size)
{
    uint8_t body[QLINK_MAX_FRAME_SIZE];
    qlink_frame_t frame;

    if (qlink_frame_decode(&frame, body, wire, size) != QLINK_OK || frame.id != QLINK_MOTION_RESPONSE_ID
        || frame.node < QLINK_FIRST_NODE || frame.node > QLINK_LAST_NODE) {
        return -1;
    }
    *node = frame.node;
    return qlink_motion_response_decode(message, frame.payload, frame.size);
}

CALL int call_hand_receive(hand_receiver *receiver, uint8_t byte)
{
    return hand_receive(receiver, byte);
}

CALL int call_receive(qlink_receiver_t *receiver, uint8_t byte)
{
    return qlink_receive(receiver, byte) == QLINK_EVENT_FRAME;
}

static void run_hand_encode(void)
{
    uint8_t wire[ROOM];
    for (int i = 0; i < MESSAGES; ++i) {
        sink += (unsigned)call_hand_encode(&hand_messages[i], wire, capacity) + wire[5];
    }
}

static void run_encode(void)
{
    uint8_t wire[ROOM];
    for (int i = 0; i < MESSAGES; ++i) {
        sink += (unsigned)call_encode(&messages[i], hand_messages[i].node, wire, capacity) + wire[5];
    }
}

static void run_hand_decode(void)
{
    hand_response message;
    for (int i = 0; i < MESSAGES; ++i) {
        sink += (unsigned)call_hand_decode(&message, wires[i], sizes[i]) + message.counter;
    }
}

static void run_decode(void)
{
    qlink_motion_response_t message;
    uint8_t node = 0;
    for (int i = 0; i < MESSAGES; ++i) {
        sink += (unsigned)call_decode(&message, &node, wires[i], sizes[i]) + message.counter + node;
    }
}

static void run_hand_receive(void)
{
    hand_receiver receiver = {0};
    hand_response message;
    for (int i = 0; i < MESSAGES; ++i) {
        for (size_t at = 0; at < sizes[i]; ++at) {
            if (call_hand_receive(&receiver, wires[i][at]) && hand_fields(&message, receiver.body) == 0) {
                sink += message.counter;
            }
        }
    }
}

static void run_receive(void)
{
    qlink_receiver_t receiver;
    qlink_motion_response_t message;
    qlink_receiver_init(&receiver);
    for (int i = 0; i < MESSAGES; ++i) {
        for (size_t at = 0; at < sizes[i]; ++at) {
            if (call_receive(&receiver, wires[i][at])) {
                const qlink_frame_t frame = qlink_receiver_frame(&receiver);
                if (frame.id == QLINK_MOTION_RESPONSE_ID
                    && qlink_motion_response_decode(&message, frame.payload, frame.size) == QLINK_OK) {
                    sink += message.counter;
                }
            }
        }
    }
}

static const struct {
    const char *name;
    void (*run)(void);
} cases[] = {
    {"hand encode", run_hand_encode},   {"generated encode", run_encode},
    {"hand decode", run_hand_decode},   {"generated decode", run_decode},
    {"hand receive", run_hand_receive}, {"generated receive", run_receive},
};
enum { CASES = sizeof cases / sizeof *cases };

/* Moving axes: counters increment, positions change slowly, few bits change. */
static void make_messages(void)
{
    uint32_t chance = 1;
    int32_t position = -746455;
    for (int i = 0; i < MESSAGES; ++i) {
        chance = chance * 1664525u + 1013904223u;
        position += (int32_t)(chance >> 19) - 3000;
        hand_messages[i] = (hand_response){
            (uint8_t)(1 + i % 16), (uint8_t)(i / 16), (uint8_t)(chance >> 30), position, 3, (uint8_t)(chance >> 24),
        };
        messages[i].counter = hand_messages[i].counter;
        messages[i].inputs = hand_messages[i].inputs;
        messages[i].position = hand_messages[i].position;
        messages[i].motor_status = hand_messages[i].motor_status;
        messages[i].fifo_space = hand_messages[i].fifo_space;
    }
}

/* Checks that both sides agree before they are timed. */
static int agree(int i)
{
    uint8_t wire[ROOM];
    hand_response mine;
    qlink_motion_response_t theirs;
    uint8_t node = 0;
    const int size = call_hand_encode(&hand_messages[i], wires[i], capacity);

    sizes[i] = (size_t)size;
    return size > 0 && call_encode(&messages[i], hand_messages[i].node, wire, capacity) == size
        && memcmp(wire, wires[i], sizes[i]) == 0 && call_hand_decode(&mine, wire, sizes[i]) == 0
        && call_decode(&theirs, &node, wire, sizes[i]) == 0 && node == mine.node && theirs.counter == mine.counter
        && theirs.position == mine.position && theirs.motor_status == mine.motor_status
        && theirs.fifo_space == mine.fifo_space && theirs.inputs == mine.inputs;
}

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double nanoseconds(void (*run)(void))
{
    const double start = seconds();
    for (int pass = 0; pass < PASSES; ++pass) {
        run();
    }
    return (seconds() - start) * 1e9 / PASSES / MESSAGES;
}

int main(int argc, char **argv)
{
    const int rounds = (argc > 1) ? atoi(argv[1]) : 100;

    hand_init();
    make_messages();
    for (int i = 0; i < MESSAGES; ++i) {
        if (!agree(i)) {
            fprintf(stderr, "message %d: the two sides do not agree\n", i);
            return 1;
        }
    }
    for (int i = 0; i < CASES; ++i) {
        printf("%s%c", cases[i].name, (i + 1 < CASES) ? '\t' : '\n');
        cases[i].run(); /* warm */
    }
    for (int round = 0; round < rounds; ++round) {
        for (int i = 0; i < CASES; ++i) {
            printf("%.3f%c", nanoseconds(cases[i].run), (i + 1 < CASES) ? '\t' : '\n');
        }
    }
    return sink == 0xFFFFFFFFu; /* keeps the compiler from removing the work */
}
