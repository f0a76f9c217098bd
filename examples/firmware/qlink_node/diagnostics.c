#include "diagnostics.h"

#include "board.h"
#include "node.h"

#if NODE_DIAGNOSTICS

#define MARK_1 0x7Eu
#define MARK_2 0xD1u
#define MARK_SIZE 2u
#define MAX_IMAGE_BYTES (MOTOR_MAX_DATA - 1u)

/* The arguments of a request that are not read yet. */
typedef struct arguments {
    const uint8_t *at;
    uint8_t left;
} arguments_t;

void diagnostics_init(diagnostics_t *diagnostics)
{
    const counters_t zero = { 0 };
    diagnostics->counters = zero;
    diagnostics->words_check = qlink_check_start();
    diagnostics->text_check = qlink_check_start();
    diagnostics->forced = false;
    diagnostics->configuring = false;
    diagnostics->own = false;
    diagnostics->size = 0u;
}

/* ---- Reports of the node ---- */

void diagnostics_words(node_t *node, const uint16_t *words, uint8_t count)
{
    uint16_t check = node->diagnostics.words_check;
    uint8_t index;
    for (index = 0u; index < count; ++index) {
        check = qlink_check_update(check, (uint8_t)(words[index] >> 8));
        check = qlink_check_update(check, (uint8_t)words[index]);
    }
    node->diagnostics.words_check = check;
}

void diagnostics_text(node_t *node, const uint8_t *text, uint8_t size)
{
    uint16_t check = node->diagnostics.text_check;
    uint8_t index;
    for (index = 0u; index < size; ++index) {
        check = qlink_check_update(check, text[index]);
    }
    node->diagnostics.text_check = check;
}

void diagnostics_opened(node_t *node)
{
    node->diagnostics.text_check = qlink_check_start();
}

uint32_t diagnostics_inputs(const node_t *node, uint32_t inputs)
{
    return node->diagnostics.forced ? node->diagnostics.inputs : inputs;
}

/* ---- Numbers, big-endian ---- */

static void put(diagnostics_t *diagnostics, uint32_t number, uint8_t bytes)
{
    while (bytes > 0u) {
        --bytes;
        diagnostics->answer[diagnostics->size] = (uint8_t)(number >> (8u * bytes));
        ++diagnostics->size;
    }
}

static uint32_t get(arguments_t *arguments, uint8_t bytes)
{
    uint32_t number = 0u;
    arguments->left = (uint8_t)(arguments->left - bytes);
    while (bytes > 0u) {
        --bytes;
        number = (number << 8) | *arguments->at;
        ++arguments->at;
    }
    return number;
}

/* ---- Operations that read ---- */

static void tell_motions(diagnostics_t *diagnostics)
{
    const counters_t *const counters = &diagnostics->counters;
    put(diagnostics, counters->requests, 2u);
    put(diagnostics, counters->motions, 2u);
    put(diagnostics, counters->duplicates, 2u);
    put(diagnostics, counters->words, 4u);
    put(diagnostics, counters->overruns, 2u);
    put(diagnostics, counters->jumps, 2u);
}

static void tell_others(diagnostics_t *diagnostics)
{
    const counters_t *const counters = &diagnostics->counters;
    put(diagnostics, counters->syncs, 2u);
    put(diagnostics, counters->repeated_syncs, 2u);
    put(diagnostics, counters->missed_syncs, 4u);
    put(diagnostics, counters->motor_requests, 2u);
    put(diagnostics, counters->replaced_motor_requests, 2u);
    put(diagnostics, counters->refused_presets, 2u);
    put(diagnostics, counters->resets, 2u);
}

static void tell_program(node_t *node)
{
    diagnostics_t *const diagnostics = &node->diagnostics;
    const counters_t *const counters = &diagnostics->counters;
    put(diagnostics, counters->program_loads, 2u);
    put(diagnostics, counters->program_pieces, 2u);
    put(diagnostics, counters->repeated_pieces, 2u);
    put(diagnostics, counters->refused_pieces, 2u);
    put(diagnostics, (uint8_t)node->program.state, 1u);
    put(diagnostics, node->program.reader.stored, 2u);
    put(diagnostics, qlink_check_finish(diagnostics->text_check), 2u);
}

static bool tell_image(node_t *node, arguments_t *arguments)
{
    const uint16_t offset = (uint16_t)get(arguments, 2u);
    const uint8_t count = (uint8_t)get(arguments, 1u);
    uint8_t index;
    if (count > MAX_IMAGE_BYTES || offset > NODE_PROGRAM_SIZE || count > NODE_PROGRAM_SIZE - offset) {
        return false;
    }
    for (index = 0u; index < count; ++index) {
        put(&node->diagnostics, node->program.reader.image[offset + index], 1u);
    }
    return true;
}

static void tell_words(diagnostics_t *diagnostics)
{
    put(diagnostics, qlink_check_finish(diagnostics->words_check), 2u);
    put(diagnostics, diagnostics->counters.words, 4u);
}

static void tell_state(node_t *node)
{
    diagnostics_t *const diagnostics = &node->diagnostics;
    put(diagnostics, node->io.outputs, IO_BYTES);
    put(diagnostics, node->io.inputs, IO_BYTES);
    put(diagnostics, node->path.position, 4u);
    put(diagnostics, node->path.waiting, 1u);
    put(diagnostics, node->path.started, 1u);
    put(diagnostics, path_fifo_running(&node->path), 1u);
    put(diagnostics, node->now, 4u);
    put(diagnostics, board_overruns(), 2u);
}

/* ---- Operations that write ---- */

static bool force_inputs(node_t *node, arguments_t *arguments)
{
    const uint32_t inputs = get(arguments, IO_BYTES);
    const uint32_t at_power_up = get(arguments, 1u);
    if (at_power_up > 1u) {
        return false;
    }
    node->diagnostics.forced = true;
    node->diagnostics.inputs = inputs;
    if (at_power_up != 0u) {
        node->io.inputs = inputs;
        node->io.changing = false;
    }
    io_image_advance(&node->io, inputs, node->now);
    return true;
}

static node_settings_t settings_of(arguments_t *arguments)
{
    node_settings_t settings;
    settings.capacity = (uint8_t)get(arguments, 1u);
    settings.rate = get(arguments, 4u);
    settings.started = get(arguments, 1u) != 0u;
    settings.t1_tenths = (uint8_t)get(arguments, 1u);
    settings.t2_tenths = (uint8_t)get(arguments, 1u);
    settings.position_type = (uint8_t)get(arguments, 1u);
    settings.serial = get(arguments, 4u);
    settings.number = (uint8_t)get(arguments, 1u);
    settings.motor_ms = (uint16_t)get(arguments, 2u);
    return settings;
}

static bool configure(node_t *node, arguments_t *arguments)
{
    const node_settings_t settings = settings_of(arguments);
    if (settings.number < QLINK_FIRST_NODE || settings.number > QLINK_LAST_NODE) {
        return false;
    }
#if NODE_FIFO < UINT8_MAX /* with 255, every byte is a capacity, and compilers warn of the comparison */
    if (settings.capacity > NODE_FIFO) {
        return false;
    }
#endif
    node->diagnostics.settings = settings;
    node->diagnostics.configuring = true;
    return true;
}

/* An answered frame is a request to this node. The others are decoded once more: no answer waits for it. */
static bool is_request(const node_t *node, const qlink_frame_t *frame, size_t size)
{
    return size > 0u ||
        ((frame->node == node->slave.node || frame->node == QLINK_BROADCAST) && qlink_request_check(frame) == QLINK_OK);
}

void diagnostics_handled(node_t *node, const qlink_frame_t *frame, size_t size)
{
    diagnostics_t *const diagnostics = &node->diagnostics;
    if (!diagnostics->own && is_request(node, frame, size)) {
        COUNT(node, requests);
    }
    diagnostics->own = false;
    if (diagnostics->configuring && diagnostics->size == 0u) {
        const node_settings_t settings = diagnostics->settings; /* power-up clears it */
        node_power_up(node, &settings, board_inputs(), node->now);
    }
}

#define DROP_UNLESS(bit, command) \
    if (((mask >> (bit)) & 1u) == 0u) { \
        slave->command = NULL; \
    }

static void choose_commands(node_t *node, uint32_t mask)
{
    qlink_slave_t *const slave = &node->slave;
    node_set_functions(node);
    DROP_UNLESS(0, node_setup)
    DROP_UNLESS(1, node_info)
    DROP_UNLESS(2, node_start)
    DROP_UNLESS(3, node_stop)
    DROP_UNLESS(4, node_sync)
    DROP_UNLESS(5, node_program_load)
    DROP_UNLESS(6, node_reset)
    DROP_UNLESS(9, motion)
    DROP_UNLESS(10, motor_position)
    DROP_UNLESS(11, clear_fifo)
    DROP_UNLESS(12, preset_motor_position)
    DROP_UNLESS(13, read)
    DROP_UNLESS(14, write)
    DROP_UNLESS(15, write_read)
    DROP_UNLESS(16, set_outputs)
    DROP_UNLESS(17, clear_outputs)
    DROP_UNLESS(18, loop_back)
}

static bool choose_motor(node_t *node, arguments_t *arguments)
{
    const uint32_t which = get(arguments, 1u);
    node->motor.backwards = which == 1u;
    return which <= 1u;
}

/* ---- The channel ---- */

static uint8_t size_of_arguments(uint8_t operation)
{
    switch (operation) {
    case DIAGNOSTICS_IMAGE:
        return 3u;
    case DIAGNOSTICS_INPUTS:
    case DIAGNOSTICS_POSITION:
    case DIAGNOSTICS_COMMANDS:
        return 4u;
    case DIAGNOSTICS_CONFIGURE:
        return 16u;
    case DIAGNOSTICS_MOTOR:
        return 1u;
    default:
        return 0u;
    }
}

/* Runs an operation; returns false if it is unknown or its arguments are wrong. */
static bool operate(node_t *node, uint8_t operation, arguments_t *arguments)
{
    switch (operation) {
    case DIAGNOSTICS_MOTIONS:
        tell_motions(&node->diagnostics);
        return true;
    case DIAGNOSTICS_OTHERS:
        tell_others(&node->diagnostics);
        return true;
    case DIAGNOSTICS_PROGRAM:
        tell_program(node);
        return true;
    case DIAGNOSTICS_IMAGE:
        return tell_image(node, arguments);
    case DIAGNOSTICS_WORDS:
        tell_words(&node->diagnostics);
        return true;
    case DIAGNOSTICS_INPUTS:
        return force_inputs(node, arguments);
    case DIAGNOSTICS_STATE:
        tell_state(node);
        return true;
    case DIAGNOSTICS_CONFIGURE:
        return configure(node, arguments);
    case DIAGNOSTICS_POSITION:
        node->path.position = get(arguments, 4u);
        return true;
    case DIAGNOSTICS_COMMANDS:
        choose_commands(node, get(arguments, 4u));
        return true;
    case DIAGNOSTICS_MOTOR:
        return choose_motor(node, arguments);
    default:
        return false;
    }
}

bool diagnostics_take(node_t *node, const qlink_motor_request_request_t *request)
{
    const uint8_t *const data = request->motor_data;
    diagnostics_t *const diagnostics = &node->diagnostics;
    arguments_t arguments = { data + MARK_SIZE + 1u, 0u };
    uint8_t operation = 0u;

    if (request->motor_data_size < MARK_SIZE || data[0] != MARK_1 || data[1] != MARK_2) {
        return false;
    }
    diagnostics->own = true;
    diagnostics->configuring = false;
    diagnostics->size = 0u;
    if (request->motor_data_size > MARK_SIZE) {
        operation = data[MARK_SIZE];
        arguments.left = (uint8_t)(request->motor_data_size - MARK_SIZE - 1u);
    }
    put(diagnostics, operation, 1u);
    if (arguments.left != size_of_arguments(operation) || !operate(node, operation, &arguments)) {
        diagnostics->size = 0u;
        put(diagnostics, DIAGNOSTICS_WRONG, 1u);
        put(diagnostics, operation, 1u);
    }
    return true;
}

bool diagnostics_poll(node_t *node, qlink_motor_response_poll_response_t *response)
{
    diagnostics_t *const diagnostics = &node->diagnostics;
    uint8_t index;
    if (diagnostics->size == 0u) {
        return false;
    }
    diagnostics->own = true;
    response->last_completion = QLINK_MOTOR_REQUEST_REQUEST_ID;
    response->motor_data_size = diagnostics->size;
    for (index = 0u; index < diagnostics->size; ++index) {
        response->motor_data[index] = diagnostics->answer[index];
    }
    diagnostics->size = 0u;
    return true;
}

#endif
