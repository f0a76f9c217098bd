#include "path_fifo.h"

#define MILLISECONDS 1000u /* in a second */
#define MAX_RATE 1000000ul

void path_fifo_init(path_fifo_t *path, uint8_t capacity, uint32_t rate, uint32_t now)
{
    path->capacity = capacity;
    path->rate = (rate > MAX_RATE) ? MAX_RATE : rate;
    path->position = 0u;
    path->then = now;
    path->started = false;
    path_fifo_clear(path);
}

/* The next index in the ring; without a division, which is slow on an 8-bit processor. */
static uint8_t after(uint8_t place, uint8_t count)
{
    const uint16_t sum = (uint16_t)(place + count);
    return (uint8_t)((sum < NODE_FIFO) ? sum : sum - NODE_FIFO);
}

static void do_word(path_fifo_t *path)
{
    const uint16_t word = path->words[path->first];
    path->position += ((word & 0x8000u) != 0u) ? 0xFFFF0000u | word : word;
    path->first = after(path->first, 1u);
    --path->waiting;
}

void path_fifo_advance(path_fifo_t *path, uint32_t now)
{
    uint32_t elapsed = now - path->then;
    path->then = now;
    while (elapsed > 0u && path_fifo_running(path)) {
        /* Second by second, so that the product fits into 32 bits. */
        const uint32_t step = (elapsed < MILLISECONDS) ? elapsed : MILLISECONDS;
        elapsed -= step;
        path->thousandths += step * path->rate;
        while (path->thousandths >= MILLISECONDS && path_fifo_running(path)) {
            path->thousandths -= MILLISECONDS;
            do_word(path);
        }
    }
    if (!path_fifo_running(path)) {
        path->thousandths = 0u;
    }
}

bool path_fifo_push(path_fifo_t *path, const uint16_t *words, uint8_t count)
{
    uint8_t place = after(path->first, path->waiting);
    uint8_t index;
    if (count > path_fifo_space(path)) {
        return false;
    }
    for (index = 0u; index < count; ++index) {
        path->words[place] = words[index];
        place = after(place, 1u);
    }
    path->waiting = (uint8_t)(path->waiting + count);
    return true;
}

void path_fifo_start(path_fifo_t *path)
{
    path->started = true;
}

void path_fifo_stop(path_fifo_t *path)
{
    path->started = false;
    path->thousandths = 0u;
}

void path_fifo_clear(path_fifo_t *path)
{
    path->first = 0u;
    path->waiting = 0u;
    path->thousandths = 0u;
}

uint8_t path_fifo_space(const path_fifo_t *path)
{
    return (uint8_t)(path->capacity - path->waiting);
}

bool path_fifo_running(const path_fifo_t *path)
{
    return path->started && path->waiting > 0u;
}
