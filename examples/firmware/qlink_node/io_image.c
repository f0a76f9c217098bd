#include "io_image.h"

#include <string.h>

#define FIRST 1ul /* input 1 and output 1 */

void io_image_init(io_image_t *io, uint32_t inputs)
{
    io->inputs = inputs & IO_ALL;
    io_image_clear(io);
}

static void do_change(io_image_t *io, uint32_t now)
{
    if (io->changing && now - io->edge >= io->delay) {
        io->changing = false;
        io_image_write(io, io->inputs, FIRST);
    }
}

void io_image_advance(io_image_t *io, uint32_t inputs, uint32_t now)
{
    do_change(io, now);
    if (((inputs ^ io->inputs) & FIRST) != 0u) {
        io->edge = now;
        io->delay = ((inputs & FIRST) != 0u) ? io->t1 : io->t2;
        io->changing = true;
    }
    io->inputs = inputs & IO_ALL;
    do_change(io, now);
}

void io_image_write(io_image_t *io, uint32_t outputs, uint32_t mask)
{
    io->outputs = ((io->outputs & ~mask) | (outputs & mask)) & IO_ALL;
}

void io_image_clear(io_image_t *io)
{
    io->outputs = 0u;
    io->changing = false;
}

void io_image_read_bytes(const io_image_t *io, uint8_t offset, uint8_t *bytes, uint8_t size)
{
    uint8_t index;
    memset(bytes, 0, size);
    for (index = 0u; index < size && offset < IO_BYTES; ++index, ++offset) {
        bytes[index] = (uint8_t)(io->inputs >> (8u * offset));
    }
}

void io_image_write_bytes(io_image_t *io, uint8_t offset, const uint8_t *bytes, uint8_t size)
{
    uint8_t index;
    for (index = 0u; index < size && offset < IO_BYTES; ++index, ++offset) {
        io_image_write(io, (uint32_t)bytes[index] << (8u * offset), (uint32_t)UINT8_MAX << (8u * offset));
    }
}
