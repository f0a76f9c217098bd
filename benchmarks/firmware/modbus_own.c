/* The slave of modbus.h with the generated header. */
#include "modbus.h"
#include "modbus_rtu.h"

#define REFUSED(name) modbus_rtu_##name##_exception_answer(own, &(modbus_rtu_##name##_exception_t){ 2U })

static bool on_read_coils(modbus_rtu_slave_t *own, const modbus_rtu_read_coils_request_t *request,
    modbus_rtu_read_coils_response_t *response)
{
    if (!inside(request->start, request->quantity)) {
        return REFUSED(read_coils);
    }
    for (uint16_t i = 0; i < request->quantity; ++i) {
        response->coils[i] = coils[request->start + i];
    }
    return true;
}

static bool on_read_discrete_inputs(modbus_rtu_slave_t *own, const modbus_rtu_read_discrete_inputs_request_t *request,
    modbus_rtu_read_discrete_inputs_response_t *response)
{
    if (!inside(request->start, request->quantity)) {
        return REFUSED(read_discrete_inputs);
    }
    for (uint16_t i = 0; i < request->quantity; ++i) {
        response->inputs[i] = coils[request->start + i];
    }
    return true;
}

static bool on_read_holding_registers(modbus_rtu_slave_t *own,
    const modbus_rtu_read_holding_registers_request_t *request, modbus_rtu_read_holding_registers_response_t *response)
{
    if (!inside(request->start, request->quantity)) {
        return REFUSED(read_holding_registers);
    }
    for (uint16_t i = 0; i < request->quantity; ++i) {
        response->registers[i] = registers[request->start + i];
    }
    return true;
}

static bool on_read_input_registers(modbus_rtu_slave_t *own, const modbus_rtu_read_input_registers_request_t *request,
    modbus_rtu_read_input_registers_response_t *response)
{
    if (!inside(request->start, request->quantity)) {
        return REFUSED(read_input_registers);
    }
    for (uint16_t i = 0; i < request->quantity; ++i) {
        response->registers[i] = registers[request->start + i];
    }
    return true;
}

static bool on_write_single_coil(modbus_rtu_slave_t *own, const modbus_rtu_write_single_coil_request_t *request,
    modbus_rtu_write_single_coil_response_t *response)
{
    if (!inside(request->number, 1)) {
        return REFUSED(write_single_coil);
    }
    coils[request->number] = request->value != 0U;
    response->number = request->number;
    response->value = request->value;
    return true;
}

static bool on_write_single_register(modbus_rtu_slave_t *own,
    const modbus_rtu_write_single_register_request_t *request, modbus_rtu_write_single_register_response_t *response)
{
    if (!inside(request->number, 1)) {
        return REFUSED(write_single_register);
    }
    registers[request->number] = request->value;
    response->number = request->number;
    response->value = request->value;
    return true;
}

static bool on_write_multiple_coils(modbus_rtu_slave_t *own, const modbus_rtu_write_multiple_coils_request_t *request,
    modbus_rtu_write_multiple_coils_response_t *response)
{
    if (!inside(request->start, request->coils_count)) {
        return REFUSED(write_multiple_coils);
    }
    for (uint16_t i = 0; i < request->coils_count; ++i) {
        coils[request->start + i] = request->coils[i];
    }
    response->start = request->start;
    response->quantity = request->coils_count;
    return true;
}

static bool on_write_multiple_registers(modbus_rtu_slave_t *own,
    const modbus_rtu_write_multiple_registers_request_t *request,
    modbus_rtu_write_multiple_registers_response_t *response)
{
    if (!inside(request->start, request->registers_count)) {
        return REFUSED(write_multiple_registers);
    }
    for (uint16_t i = 0; i < request->registers_count; ++i) {
        registers[request->start + i] = request->registers[i];
    }
    response->start = request->start;
    response->quantity = request->registers_count;
    return true;
}

static modbus_rtu_receiver_t receiver;
static modbus_rtu_slave_t slave;
static uint8_t answer[MODBUS_RTU_MAX_WIRE_SIZE];

static void receive(uint8_t byte)
{
    modbus_rtu_event_t event = modbus_rtu_receive(&receiver, byte);
    while (event != MODBUS_RTU_EVENT_NONE) {
        if (event == MODBUS_RTU_EVENT_FRAME) {
            const modbus_rtu_frame_t frame = modbus_rtu_receiver_frame(&receiver);
            const size_t size = modbus_rtu_slave_dispatch(&slave, &frame, answer, sizeof answer);
            for (size_t i = 0; i < size; ++i) {
                port = answer[i];
            }
        }
        event = modbus_rtu_receiver_next(&receiver);
    }
}

int main(void)
{
    modbus_rtu_receiver_init(&receiver, MODBUS_RTU_REQUEST);
    slave.node = 1U;
    slave.read_coils = on_read_coils;
    slave.read_discrete_inputs = on_read_discrete_inputs;
    slave.read_holding_registers = on_read_holding_registers;
    slave.read_input_registers = on_read_input_registers;
    slave.write_single_coil = on_write_single_coil;
    slave.write_single_register = on_write_single_register;
    slave.write_multiple_coils = on_write_multiple_coils;
    slave.write_multiple_registers = on_write_multiple_registers;
    for (;;) {
        receive(port);
    }
}
