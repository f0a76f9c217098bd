/* First part of every fuzz target: an input read byte by byte, and allocations of exactly the requested size. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REQUIRE(condition) ((condition) ? (void)0 : refuted(#condition, __func__, __LINE__))
#define IN_RANGE(value, least, most) ((value) >= (least) && (value) <= (most))

static void refuted(const char *condition, const char *function, int line)
{
    (void)fprintf(stderr, "not so: %s (in %s, line %d)\n", condition, function, line);
    abort();
}

typedef struct {
    const uint8_t *at;
    size_t left;
} input_t;

/* Outcomes that a compiler may compute without a branch: libFuzzer keeps an input for each of these as well. */
#ifdef REPLAY
#define OUTCOMES
#else
#define OUTCOMES __attribute__((section("__libfuzzer_extra_counters")))
#endif

/* Zeros after the end of the input. */
static inline uint8_t take(input_t *input)
{
    if (input->left == 0u) { return 0u; }
    --input->left;
    return *input->at++;
}

static inline uint64_t take_number(input_t *input, size_t bytes)
{
    uint64_t number = 0u;
    for (size_t index = 0u; index < bytes; ++index) { number = number << 8 | take(input); }
    return number;
}

/* A number of steps: any double, or a few quarters above a whole number, the minimum or the maximum. */
static inline double take_steps(input_t *input, double least, double most)
{
    const uint8_t kind = take(input);
    const double quarters = (double)(int8_t)take(input) / 4.0;
    const uint64_t bits = take_number(input, sizeof bits);
    double any;
    memcpy(&any, &bits, sizeof any);
    switch (kind % 4u) {
    case 0u: return (double)(int16_t)bits + quarters;
    case 1u: return least + quarters;
    case 2u: return most + quarters;
    default: return any;
    }
}

/* Often the largest capacity, otherwise a random one. */
static inline size_t take_capacity(input_t *input, size_t most)
{
    const uint8_t chosen = take(input);
    return (chosen % 2u == 0u) ? most : (size_t)take_number(input, 2u) % (most + 1u);
}

/* An allocation of its own, so that an access before or after it is reported. For zero bytes it is the end of an
 * unused allocation, because the smallest one on the heap has one byte. */
static uint8_t none[8];

static inline uint8_t *room(size_t size)
{
    uint8_t *const memory = (size == 0u) ? none + sizeof none : (uint8_t *)malloc(size);
    if (memory == NULL) { exit(2); }
    return memory;
}

static inline void release(void *memory)
{
    if ((uint8_t *)memory != none + sizeof none) { free(memory); }
}

static inline uint8_t *copy(const uint8_t *bytes, size_t size)
{
    uint8_t *const memory = room(size);
    if (size != 0u) { memcpy(memory, bytes, size); }
    return memory;
}
