/* A Modbus RTU slave of functions 1 to 6, 15 and 16 with 64 coils and 64 registers: what both programs have. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SIZE 64U

volatile uint8_t port;
static uint8_t coils[SIZE];
static uint16_t registers[SIZE];

static bool inside(uint16_t start, uint16_t count)
{
    return start < SIZE && count <= SIZE - start;
}
