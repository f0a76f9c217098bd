/* The slave of modbus.h with nanoMODBUS, whose source is given as an option. */
#include "modbus.h"
#include "nanomodbus.h"

static nmbs_error read_bits(uint16_t start, uint16_t count, nmbs_bitfield out, uint8_t unit, void *arg)
{
    (void)unit;
    (void)arg;
    if (!inside(start, count)) {
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    }
    for (uint16_t i = 0; i < count; ++i) {
        nmbs_bitfield_write(out, i, coils[start + i]);
    }
    return NMBS_ERROR_NONE;
}

static nmbs_error read_words(uint16_t start, uint16_t count, uint16_t *out, uint8_t unit, void *arg)
{
    (void)unit;
    (void)arg;
    if (!inside(start, count)) {
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    }
    for (uint16_t i = 0; i < count; ++i) {
        out[i] = registers[start + i];
    }
    return NMBS_ERROR_NONE;
}

static nmbs_error write_bit(uint16_t number, bool value, uint8_t unit, void *arg)
{
    (void)unit;
    (void)arg;
    if (!inside(number, 1)) {
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    }
    coils[number] = value;
    return NMBS_ERROR_NONE;
}

static nmbs_error write_word(uint16_t number, uint16_t value, uint8_t unit, void *arg)
{
    (void)unit;
    (void)arg;
    if (!inside(number, 1)) {
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    }
    registers[number] = value;
    return NMBS_ERROR_NONE;
}

static nmbs_error write_bits(uint16_t start, uint16_t count, const nmbs_bitfield values, uint8_t unit, void *arg)
{
    (void)unit;
    (void)arg;
    if (!inside(start, count)) {
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    }
    for (uint16_t i = 0; i < count; ++i) {
        coils[start + i] = nmbs_bitfield_read(values, i);
    }
    return NMBS_ERROR_NONE;
}

static nmbs_error write_words(uint16_t start, uint16_t count, const uint16_t *values, uint8_t unit, void *arg)
{
    (void)unit;
    (void)arg;
    if (!inside(start, count)) {
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    }
    for (uint16_t i = 0; i < count; ++i) {
        registers[start + i] = values[i];
    }
    return NMBS_ERROR_NONE;
}

static int32_t get(uint8_t *bytes, uint16_t count, int32_t timeout, void *arg)
{
    (void)timeout;
    (void)arg;
    for (uint16_t i = 0; i < count; ++i) {
        bytes[i] = port;
    }
    return count;
}

static int32_t put(const uint8_t *bytes, uint16_t count, int32_t timeout, void *arg)
{
    (void)timeout;
    (void)arg;
    for (uint16_t i = 0; i < count; ++i) {
        port = bytes[i];
    }
    return count;
}

static nmbs_t server;

int main(void)
{
    nmbs_platform_conf platform;
    nmbs_callbacks callbacks;
    nmbs_platform_conf_create(&platform);
    platform.transport = NMBS_TRANSPORT_RTU;
    platform.read = get;
    platform.write = put;
    nmbs_callbacks_create(&callbacks);
    callbacks.read_coils = read_bits;
    callbacks.read_discrete_inputs = read_bits;
    callbacks.read_holding_registers = read_words;
    callbacks.read_input_registers = read_words;
    callbacks.write_single_coil = write_bit;
    callbacks.write_single_register = write_word;
    callbacks.write_multiple_coils = write_bits;
    callbacks.write_multiple_registers = write_words;
    (void)nmbs_server_create(&server, 1, &platform, &callbacks);
    for (;;) {
        (void)nmbs_server_poll(&server);
    }
}
