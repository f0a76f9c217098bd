#define QLINK_CRC_DEFINE_TABLE /* the one table where several files use one */
#include "node.h"

#include <string.h>

/* Milliseconds per step of T1 and T2. */
#define STEP_MS (1000u * QLINK_TENTHS_FACTOR / QLINK_TENTHS_DIVISOR)

static node_t *node_of(qlink_slave_t *slave)
{
    return (node_t *)slave->context;
}

static void set_delays(node_t *node, uint8_t t1_tenths, uint8_t t2_tenths)
{
    node->settings.t1_tenths = t1_tenths;
    node->settings.t2_tenths = t2_tenths;
    node->io.t1 = (uint16_t)(t1_tenths * STEP_MS);
    node->io.t2 = (uint16_t)(t2_tenths * STEP_MS);
}

/* ---- Node (7.1 to 7.7) ---- */

static bool on_node_setup(qlink_slave_t *slave, const qlink_node_setup_request_t *request)
{
    node_t *const node = node_of(slave);
    slave->node = request->node_number; /* the answer carries it already */
    node->settings.number = request->node_number;
    set_delays(node, request->t1_delay, request->t2_delay);
    node->settings.position_type = request->position_type;
    node->settings_changed = true;
    return true;
}

static bool on_node_info(qlink_slave_t *slave, qlink_node_info_response_t *response)
{
    const node_settings_t *const settings = &node_of(slave)->settings;
    response->version_major = NODE_VERSION_MAJOR;
    response->version_minor = NODE_VERSION_MINOR;
    response->product_id = NODE_PRODUCT;
    response->t1_delay = settings->t1_tenths;
    response->t2_delay = settings->t2_tenths;
    response->position_type = settings->position_type;
    response->serial_number = settings->serial;
    return true;
}

static void on_node_start(qlink_slave_t *slave)
{
    path_fifo_start(&node_of(slave)->path);
}

static void on_node_stop(qlink_slave_t *slave)
{
    path_fifo_stop(&node_of(slave)->path);
}

static void on_node_sync(qlink_slave_t *slave, const qlink_node_sync_request_t *request)
{
    node_t *const node = node_of(slave);
    COUNT(node, syncs);
    if (node->sync.known) {
        const uint8_t ahead = (uint8_t)(request->counter - node->sync.last);
        if (ahead == 0u) {
            COUNT(node, repeated_syncs);
        } else {
            COUNT_MORE(node, missed_syncs, ahead - 1u);
        }
    }
    node->sync.known = true;
    node->sync.last = request->counter;
}

static bool on_node_program_load(qlink_slave_t *slave, const qlink_node_program_load_request_t *request,
    qlink_node_program_load_response_t *response)
{
    node_t *const node = node_of(slave);
    response->counter = request->counter;
    switch (program_store_take(&node->program, request->counter, request->program_data, request->program_data_size)) {
    case PROGRAM_OPENED:
        COUNT(node, program_loads);
        diagnostics_opened(node);
        return true;
    case PROGRAM_STORED:
        COUNT(node, program_pieces);
        diagnostics_text(node, request->program_data, request->program_data_size);
        return true;
    case PROGRAM_REPEATED:
        COUNT(node, repeated_pieces);
        return true;
    case PROGRAM_REFUSED:
    default:
        COUNT(node, refused_pieces);
        return false;
    }
}

static bool on_node_reset(qlink_slave_t *slave)
{
    node_t *const node = node_of(slave);
    COUNT(node, resets);
    path_fifo_clear(&node->path);
    node->path.started = node->settings.started;
    io_image_clear(&node->io);
    motor_forget(&node->motor);
    node->motion.known = false;
    node->sync.known = false;
    return true;
}

/* ---- Motor (7.8 to 7.13) ---- */

static bool on_motor_response_poll(qlink_slave_t *slave, qlink_motor_response_poll_response_t *response)
{
    const motor_t *const motor = &node_of(slave)->motor;
    if (diagnostics_poll(node_of(slave), response)) {
        return true;
    }
    if (motor->completed) {
        response->last_completion = QLINK_MOTOR_REQUEST_REQUEST_ID;
        response->motor_data_size = motor->size;
        memcpy(response->motor_data, motor->answer, motor->size);
    }
    return true;
}

static bool on_motor_request(qlink_slave_t *slave, const qlink_motor_request_request_t *request)
{
    node_t *const node = node_of(slave);
    if (diagnostics_take(node, request)) {
        return true;
    }
    COUNT(node, motor_requests);
    if (motor_take(&node->motor, request->motor_data, request->motor_data_size, node->now)) {
        COUNT(node, replaced_motor_requests);
    }
    return true;
}

/* A node with a position type that the document does not name has no position. */
static bool is_position_known(const node_t *node)
{
    return node->settings.position_type != QLINK_POSITION_TYPE_NONE &&
        qlink_position_type_is_valid(node->settings.position_type);
}

static int32_t told_position(const node_t *node)
{
    return is_position_known(node) ? node_position(node) : 0;
}

static qlink_motor_status_t motor_status(const node_t *node)
{
    const unsigned running = path_fifo_running(&node->path) ? QLINK_MOTOR_STATUS_RUNNING : 0u;
    return (qlink_motor_status_t)(running | (is_position_known(node) ? QLINK_MOTOR_STATUS_POSITION_VALID : 0u));
}

/* Queues a new motion, all of it or nothing. */
static bool take_motion(node_t *node, const qlink_motion_request_t *request)
{
    if (!path_fifo_push(&node->path, request->segments, request->segments_count)) {
        COUNT(node, overruns);
        return false;
    }
    if (node->motion.known && request->counter != (uint8_t)(node->motion.last + 1u)) {
        COUNT(node, jumps);
    }
    node->motion.known = true;
    node->motion.last = request->counter;
    io_image_write(&node->io, request->outputs, UINT8_MAX);
    COUNT(node, motions);
    COUNT_MORE(node, words, request->segments_count);
    diagnostics_words(node, request->segments, request->segments_count);
    return true;
}

static bool on_motion(qlink_slave_t *slave, const qlink_motion_request_t *request, qlink_motion_response_t *response)
{
    node_t *const node = node_of(slave);
    if (node->motion.known && request->counter == node->motion.last) {
        COUNT(node, duplicates);
    } else if (!take_motion(node, request)) {
        return false; /* an answer would tell the master that its path is queued */
    } else {
        /* taken */
    }
    response->counter = request->counter;
    response->inputs = (uint8_t)node->io.inputs;
    response->position = told_position(node);
    response->motor_status = motor_status(node);
    response->fifo_space = path_fifo_space(&node->path);
    return true;
}

static bool on_motor_position(qlink_slave_t *slave, qlink_motor_position_response_t *response)
{
    response->position = told_position(node_of(slave));
    return true;
}

static bool on_clear_fifo(qlink_slave_t *slave)
{
    path_fifo_clear(&node_of(slave)->path);
    node_of(slave)->motion.known = false; /* the next motion is new */
    return true;
}

static bool on_preset_motor_position(qlink_slave_t *slave, const qlink_preset_motor_position_request_t *request)
{
    node_t *const node = node_of(slave);
    if (path_fifo_running(&node->path)) {
        COUNT(node, refused_presets);
        return false;
    }
    node->path.position = (uint32_t)request->position;
    return true;
}

/* ---- Inputs and outputs (7.14 to 7.19) ---- */

static bool on_read(qlink_slave_t *slave, const qlink_read_request_t *request, qlink_read_response_t *response)
{
    response->data_size = request->size;
    io_image_read_bytes(&node_of(slave)->io, request->offset, response->data, request->size);
    return true;
}

static bool on_write(qlink_slave_t *slave, const qlink_write_request_t *request)
{
    io_image_write_bytes(&node_of(slave)->io, request->offset, request->data, request->data_size);
    return true;
}

static bool on_write_read(qlink_slave_t *slave, const qlink_write_read_request_t *request,
    qlink_write_read_response_t *response)
{
    io_image_write(&node_of(slave)->io, request->outputs, IO_ALL);
    response->inputs = node_of(slave)->io.inputs;
    return true;
}

static bool on_set_outputs(qlink_slave_t *slave, const qlink_set_outputs_request_t *request)
{
    io_image_write(&node_of(slave)->io, request->mask, request->mask);
    return true;
}

static bool on_clear_outputs(qlink_slave_t *slave, const qlink_clear_outputs_request_t *request)
{
    io_image_write(&node_of(slave)->io, 0u, request->mask);
    return true;
}

static bool on_loop_back(qlink_slave_t *slave, const qlink_loop_back_request_t *request,
    qlink_loop_back_response_t *response)
{
    (void)slave;
    response->offset = request->offset;
    response->data_size = request->data_size;
    memcpy(response->data, request->data, request->data_size);
    return true;
}

/* ---- The node ---- */

/* If your node does not know a command, leave its function out: it is not answered. */
void node_set_functions(node_t *node)
{
    qlink_slave_t *const slave = &node->slave;
    slave->node_setup = on_node_setup;
    slave->node_info = on_node_info;
    slave->node_start = on_node_start;
    slave->node_stop = on_node_stop;
    slave->node_sync = on_node_sync;
    slave->node_program_load = on_node_program_load;
    slave->node_reset = on_node_reset;
    slave->motor_response_poll = on_motor_response_poll;
    slave->motor_request = on_motor_request;
    slave->motion = on_motion;
    slave->motor_position = on_motor_position;
    slave->clear_fifo = on_clear_fifo;
    slave->preset_motor_position = on_preset_motor_position;
    slave->read = on_read;
    slave->write = on_write;
    slave->write_read = on_write_read;
    slave->set_outputs = on_set_outputs;
    slave->clear_outputs = on_clear_outputs;
    slave->loop_back = on_loop_back;
}

void node_init(node_t *node, uint32_t inputs, uint32_t now)
{
    node_settings_t settings;
    settings_load(&settings);
    qlink_receiver_init(&node->receiver);
    node_power_up(node, &settings, inputs, now);
}

void node_power_up(node_t *node, const node_settings_t *settings, uint32_t inputs, uint32_t now)
{
    node->settings = *settings;
    node->settings_changed = false;
    node->slave.node = settings->number;
    node->slave.context = node;
    node_set_functions(node);
    node->now = now;
    path_fifo_init(&node->path, settings->capacity, settings->rate, now);
    node->path.started = settings->started;
    io_image_init(&node->io, inputs);
    set_delays(node, settings->t1_tenths, settings->t2_tenths);
    motor_init(&node->motor, settings->motor_ms);
    program_store_init(&node->program);
    node->motion.known = false;
    node->sync.known = false;
    diagnostics_init(&node->diagnostics);
}

void node_advance(node_t *node, uint32_t inputs, uint32_t now)
{
    node->now = now;
    io_image_advance(&node->io, diagnostics_inputs(node, inputs), now);
    path_fifo_advance(&node->path, now);
    motor_advance(&node->motor, now);
}

bool node_receive(node_t *node, uint8_t byte)
{
    return qlink_receive(&node->receiver, byte) == QLINK_EVENT_FRAME;
}

size_t node_answer(node_t *node, uint8_t *answer)
{
    const qlink_frame_t frame = qlink_receiver_frame(&node->receiver);
    const size_t size = qlink_slave_dispatch(&node->slave, &frame, answer, QLINK_MAX_WIRE_SIZE);
    diagnostics_handled(node, &frame, size);
    return size;
}

void node_sent(node_t *node)
{
    if (node->settings_changed) {
        node->settings_changed = false;
        settings_store(&node->settings);
    }
}

int32_t node_position(const node_t *node)
{
    return (int32_t)node->path.position;
}
