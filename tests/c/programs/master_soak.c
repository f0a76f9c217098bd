/* The generated master of Q.link on a simulated line with four generated slaves and faults: no wrong answer.
 *
 * Everything is in one program without a library, so that it runs on the host under sanitizers and on a Cortex-M0. Time
 * is simulated in steps of a byte; it begins before the clock wraps. TRANSACTIONS and FAULTS (in 1000 transmissions) are
 * given. The report is TAP, as that of a conformance kit. */
#include "qlink_master.h"

#ifndef TRANSACTIONS
#define TRANSACTIONS 2000UL
#endif
#ifndef FAULTS
#define FAULTS 50UL
#endif

#define NODES 4U
#define BYTE_US 87U
#define SLACK 1000U

void conformance_put(char character);
int qlink_conformance(void);

typedef struct node {
    qlink_slave_t slave;
    qlink_receiver_t receiver;
    uint32_t made; /* number of its last answer */
} node_t;

static qlink_bus_t bus;
static qlink_job_t jobs[3];
static qlink_motor_position_response_t positions[3];
static qlink_motion_request_t motion;
static qlink_motion_response_t moved;
static node_t nodes[NODES];
static uint32_t first[3]; /* the number of answers when a job was asked */
static uint8_t line[QLINK_MAX_WIRE_SIZE]; /* the transmission of a slave */
static size_t line_size;
static size_t line_at;
static uint32_t line_begins;
static uint8_t own[QLINK_MAX_WIRE_SIZE]; /* the transmission of the master */
static size_t own_size;
static size_t own_at;
static uint32_t now = 0xFFFE0000U;
static uint32_t seed = 1U;
static uint32_t answered;
static uint32_t told;
static uint32_t failed;
static uint32_t wrong;
static uint32_t faults;
static uint32_t overlaps;

static uint32_t drawn(uint32_t most)
{
    seed = (uint32_t)((seed * 1664525UL) + 1013904223UL);
    return (seed >> 8) % most;
}

static bool on_position(qlink_slave_t *own_slave, qlink_motor_position_response_t *response)
{
    node_t *const node = own_slave->context;
    ++node->made;
    response->position = (int32_t)(((uint32_t)own_slave->node << 24) | (node->made & 0xFFFFFFUL));
    return true;
}

static bool on_motion(qlink_slave_t *own_slave, const qlink_motion_request_t *request, qlink_motion_response_t *response)
{
    (void)own_slave;
    response->counter = request->counter;
    return true;
}

static void on_sync(qlink_slave_t *own_slave, const qlink_node_sync_request_t *request)
{
    (void)own_slave;
    (void)request;
}

static void send(qlink_bus_t *sender, const uint8_t *bytes, size_t size)
{
    (void)sender;
    if ((line_size != 0U) || (own_size != 0U)) {
        ++overlaps;
    }
    for (size_t index = 0U; index < size; ++index) {
        own[index] = bytes[index];
    }
    own_size = size;
    own_at = 0U;
    if (drawn(1000U) < FAULTS) {
        ++faults;
        if (drawn(2U) == 0U) {
            own[drawn((uint32_t)size)] ^= (uint8_t)(1U << drawn(8U));
        } else {
            own_size = drawn((uint32_t)size); /* the rest is lost */
        }
    }
}

/* Lets a slave answer, perhaps with a fault. */
static void answer(const uint8_t *bytes, size_t size)
{
    for (size_t index = 0U; index < size; ++index) {
        line[index] = bytes[index];
    }
    line_size = size;
    line_at = 0U;
    line_begins = now + (3U * BYTE_US);
    if (drawn(1000U) < FAULTS) {
        ++faults;
        switch (drawn(5U)) {
        case 4U: { /* another node speaks */
            const qlink_motor_position_response_t other = {1};
            const uint8_t node = (uint8_t)(1U + (bytes[4] % NODES));
            line_size = (size_t)qlink_motor_position_response_to_frame(&other, node, line, sizeof line);
            break;
        }
        case 0U:
            line_size = 0U;
            break;
        case 1U:
            line_size = drawn((uint32_t)size);
            break;
        case 2U:
            line[drawn((uint32_t)size)] ^= (uint8_t)(1U << drawn(8U));
            break;
        default: /* the deadline is over, the line not yet quiet */
            line_begins = (uint32_t)(bus.deadline - ((uint32_t)size * BYTE_US) + 500U);
            break;
        }
    }
}

/* Passes a byte of the master to the slaves. */
static void slaves_receive(uint8_t byte)
{
    uint8_t wire[QLINK_MAX_WIRE_SIZE];
    for (size_t index = 0U; index < NODES; ++index) {
        if (qlink_receive(&nodes[index].receiver, byte) == QLINK_EVENT_FRAME) {
            const qlink_frame_t frame = qlink_receiver_frame(&nodes[index].receiver);
            const size_t size = qlink_slave_dispatch(&nodes[index].slave, &frame, wire, sizeof wire);
            if (size > 0U) {
                answer(wire, size);
            }
        }
    }
}

/* Both sides during one byte time. */
static void step(void)
{
    now += BYTE_US;
    if ((own_size != 0U) && (own_at < own_size)) {
        slaves_receive(own[own_at]);
        ++own_at;
        if (own_at == own_size) {
            own_size = 0U;
        }
    } else if ((line_size != 0U) && ((now - line_begins) < 0x80000000UL)) {
        qlink_bus_receive(&bus, line[line_at], now);
        ++line_at;
        if (line_at == line_size) {
            line_size = 0U;
        }
    } else {
        /* the line is silent */
    }
    qlink_bus_poll(&bus, now);
}

static void judge(size_t place)
{
    const qlink_job_t *const job = &jobs[place];
    if (job->outcome == QLINK_OUTCOME_DONE) {
        if (job->response == &positions[place]) {
            const uint32_t number = (uint32_t)positions[place].position & 0xFFFFFFUL;
            const uint32_t node = (uint32_t)positions[place].position >> 24;
            ++answered;
            if ((node != job->node) || (number <= first[place]) || (number > nodes[node - 1U].made)) {
                ++wrong;
            }
        } else if (job->response == &moved) {
            ++answered;
            if (moved.counter != motion.counter) {
                ++wrong;
            }
        } else {
            ++told;
        }
    } else {
        ++failed;
    }
}

static void ask(size_t place)
{
    static qlink_node_sync_request_t sync;
    const uint8_t node = (uint8_t)(1U + drawn(NODES));
    switch (drawn(8U)) {
    case 0U:
        (void)qlink_ask_node_sync(&bus, &jobs[place], &sync, now);
        break;
    case 1U:
    case 2U:
        if ((jobs[0].request != &motion) && (jobs[1].request != &motion) && (jobs[2].request != &motion)) {
            motion.counter = (uint8_t)((motion.counter + 1U) & 0xFFU);
            (void)qlink_ask_motion(&bus, &jobs[place], node, &motion, &moved, now);
            break;
        }
        (void)qlink_ask_motor_position(&bus, &jobs[place], node, &positions[place], now);
        break;
    default:
        (void)qlink_ask_motor_position(&bus, &jobs[place], node, &positions[place], now);
        break;
    }
    first[place] = nodes[jobs[place].node == 0U ? 0U : jobs[place].node - 1U].made;
}

static void put_text(const char *text)
{
    for (; *text != '\0'; ++text) {
        conformance_put(*text);
    }
}

static void put_test(bool right, char number, const char *what)
{
    put_text(right ? "ok " : "not ok ");
    conformance_put(number);
    put_text(" - ");
    put_text(what);
    put_text("\n");
    if (!right) {
        put_text("  ---\n  ...\n");
    }
}

static void done(qlink_bus_t *ended, qlink_job_t *job)
{
    (void)ended;
    judge((size_t)(job - jobs));
    job->request = NULL;
}

int qlink_conformance(void)
{
    uint32_t asked = 0U;
    uint32_t aborted = 0U;
    uint32_t steps = 0U;

    for (size_t index = 0U; index < NODES; ++index) {
        qlink_receiver_init(&nodes[index].receiver);
        nodes[index].slave.node = (uint8_t)(index + 1U);
        nodes[index].slave.context = &nodes[index];
        nodes[index].slave.motor_position = on_position;
        nodes[index].slave.motion = on_motion;
        nodes[index].slave.node_sync = on_sync;
    }
    qlink_bus_init(&bus, QLINK_BAUD, SLACK, send, now);
    for (size_t place = 0U; place < 3U; ++place) {
        jobs[place].done = done;
    }
    while ((asked < TRANSACTIONS) && (steps < (TRANSACTIONS * 1000UL))) {
        for (size_t place = 0U; place < 3U; ++place) {
            if (jobs[place].outcome != QLINK_OUTCOME_WAITING) {
                ask(place);
                ++asked;
            }
        }
        step();
        ++steps;
    }
    for (size_t place = 0U; place < 3U; ++place) {
        if (jobs[place].outcome == QLINK_OUTCOME_WAITING) {
            qlink_bus_abort(&bus, &jobs[place], now);
            ++aborted;
        }
    }
    put_text("TAP version 14\n1..5\n");
    put_test(wrong == 0U, '1', "no answer is wrong");
    put_test(overlaps == 0U, '2', "the master begins on a free line");
    put_test(faults > (TRANSACTIONS / 20UL), '3', "there are faults");
    put_test((answered > (20U * failed)) && (bus.counters.repeats > 0U) && (bus.counters.late > 0U), '4', "repeats help");
    put_test((asked >= TRANSACTIONS) && ((answered + told + failed + aborted) == asked), '5', "every job ends once");
    return ((wrong == 0U) && (overlaps == 0U)) ? 0 : 1;
}
