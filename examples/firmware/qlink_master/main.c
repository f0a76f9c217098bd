#define QLINK_CRC_DEFINE_TABLE /* the one table where several files use one */
/* A master of four nodes: the outputs of each node show the inputs of the node before it, as if wired across the bus.
 *
 * The loop asks all nodes in turn; a node that does not answer delays the others by its attempts only. */
#include "board.h"
#include "line.h"
#include "qlink_master.h"

#define NODES 4u

/* Microseconds between two rounds of the loop below: the tick, and a frame that board_send sends. */
#ifndef MASTER_SLACK_US
#define MASTER_SLACK_US 8000ul
#endif

/* 0 where bytes take no time, as in an emulator. */
#ifndef MASTER_PACED
#define MASTER_PACED 1
#endif

typedef struct station {
    qlink_job_t job;
    qlink_write_read_request_t request;
    qlink_write_read_response_t response;
    uint32_t inputs; /* in the last answer */
} station_t;

static qlink_bus_t bus;
static station_t stations[NODES];

/* The tick wraps at 2^32 milliseconds, so this wraps at 2^32 microseconds. */
static uint32_t microseconds(void)
{
    return board_milliseconds() * 1000u;
}

static void send(qlink_bus_t *own, const uint8_t *bytes, size_t size)
{
    (void)own;
    board_send(bytes, size);
}

static void answered(qlink_bus_t *own, qlink_job_t *job)
{
    station_t *const station = job->context;
    (void)own;
    if (job->outcome == QLINK_OUTCOME_DONE) {
        station->inputs = station->response.inputs;
    }
}

/* Asks all nodes that are not being asked. */
static void ask(void)
{
    for (size_t index = 0u; index < NODES; ++index) {
        station_t *const station = &stations[index];
        if (station->job.outcome != QLINK_OUTCOME_WAITING) {
            station->request.outputs = stations[(index + NODES - 1u) % NODES].inputs;
            (void)qlink_ask_write_read(
                &bus, &station->job, (uint8_t)(index + 1u), &station->request, &station->response, microseconds());
        }
    }
}

int main(void)
{
    uint8_t byte;
    board_start();
    qlink_bus_init(&bus, BOARD_BAUD, MASTER_SLACK_US, send, microseconds());
    bus.paced = (MASTER_PACED != 0);
    for (size_t index = 0u; index < NODES; ++index) {
        stations[index].job.done = answered;
        stations[index].job.context = &stations[index];
    }
    for (;;) {
        ask();
        while (board_receive(&byte)) {
            qlink_bus_receive(&bus, byte, microseconds());
        }
        qlink_bus_poll(&bus, microseconds());
        board_wait();
    }
}
