/* First part of every driver program; the writer replaces the marks with the protocol's prefix. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_SIZE 1048576
static char line[LINE_SIZE];
static uint8_t bytes_a[LINE_SIZE / 2];
static uint8_t bytes_b[LINE_SIZE / 2];

/* The memory after the bytes of a frame is marked for AddressSanitizer, so that it reports a read past them. */
#ifdef __has_feature
#if __has_feature(address_sanitizer)
#define SANITIZED 1
#endif
#endif
#if defined(SANITIZED) || defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(place, size) ((void)(place), (void)(size))
#define ASAN_UNPOISON_MEMORY_REGION(place, size) ((void)(place), (void)(size))
#endif

static char *word(void) { return strtok(NULL, " \n"); }

static int digit(char c)
{
    return (c >= '0' && c <= '9') ? c - '0' : (c >= 'a' && c <= 'f') ? c - 'a' + 10 : (c >= 'A' && c <= 'F') ? c - 'A' + 10 : -1;
}

static inline void wide_of(const char *text, uint64_t *high, uint64_t *low)
{
    const bool minus = *text == '-';
    *high = 0u;
    *low = 0u;
    for (text += minus ? 1 : 0; *text != '\0'; ++text) {
        const uint64_t small = (*low & 0xFFFFFFFFu) * 10u + (uint64_t)(*text - '0');
        const uint64_t large = (*low >> 32) * 10u + (small >> 32);
        *low = (large << 32) | (small & 0xFFFFFFFFu);
        *high = *high * 10u + (large >> 32);
    }
    if (minus) {
        *low = ~*low + 1u;
        *high = ~*high + (*low == 0u ? 1u : 0u);
    }
}

static size_t from_hex(const char *text, uint8_t *out)
{
    size_t size = 0u;
    ASAN_UNPOISON_MEMORY_REGION(out, sizeof bytes_a);
    while (text != NULL && digit(text[0]) >= 0 && digit(text[1]) >= 0) {
        out[size] = (uint8_t)(digit(text[0]) * 16 + digit(text[1]));
        ++size;
        text += 2;
    }
    if (out == bytes_a) { ASAN_POISON_MEMORY_REGION(out + size, sizeof bytes_a - size); }
    return size;
}

/* Bytes at the end of an allocation, so that a sanitizer reports a read or write past them. */
static uint8_t *copy_of(const uint8_t *bytes, size_t size)
{
    uint8_t *const memory = (uint8_t *)malloc(size + 16u);
    if (memory == NULL) { abort(); }
    memcpy(memory + 16u, bytes, size);
    return memory + 16u;
}

static void release(uint8_t *copy) { free(copy - 16u); }

static void put_digits(const uint8_t *data, size_t size)
{
    for (size_t index = 0u; index < size; ++index) { printf("%02x", data[index]); }
}

static void put_hex(const uint8_t *data, size_t size)
{
    putchar(' ');
    if (size == 0u) { putchar('-'); }
    put_digits(data, size);
}

static const char *kind_of(int status)
{
    switch (status) {
    case @P@_ERROR_CAPACITY: return "capacity";
    case @P@_ERROR_LENGTH: return "length";
    case @P@_ERROR_RANGE: return "range";
    case @P@_ERROR_UNKNOWN: return "unknown";
    case @P@_ERROR_CRC: return "crc";
    case @P@_ERROR_STUFFING: return "stuffing";
    case @P@_ERROR_TRUNCATED: return "truncated";
    case @P@_ERROR_FRAME: return "frame";
    case @P@_ERROR_ILLEGAL: return "illegal";
    default: return "?";
    }
}

static const char *kind_of_event(@p@_event_t event)
{
    switch (event) {
    case @P@_EVENT_CRC: return "crc";
    case @P@_EVENT_STUFFING: return "stuffing";
    case @P@_EVENT_LENGTH: return "length";
    case @P@_EVENT_UNKNOWN: return "unknown";
    case @P@_EVENT_TRUNCATED: return "truncated";
    case @P@_EVENT_FRAMING: return "frame";
    case @P@_EVENT_RANGE: return "range";
    default: return "?";
    }
}

static void fail(int status) { printf("error %s", kind_of(status)); }
