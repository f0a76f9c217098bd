#include "hex_reader.h"

#include <string.h>

#define ERASED 0xFF
#define NO_DIGIT 0xFFu

enum { DATA = 0, END = 1, SEGMENT = 2, SEGMENT_ENTRY = 3, LINEAR = 4, LINEAR_ENTRY = 5 };
/* Offsets in a record, in bytes; the checksum follows the data. */
enum { COUNT_AT = 0, OFFSET_AT = 1, OFFSET_LOW_AT = 2, TYPE_AT = 3, DATA_AT = 4 };

void hex_reader_init(hex_reader_t *reader)
{
    memset(reader, 0, sizeof *reader);
    memset(reader->image, ERASED, sizeof reader->image);
}

static uint8_t digit_of(uint8_t character)
{
    if (character >= '0' && character <= '9') {
        return (uint8_t)(character - '0');
    }
    character |= 0x20u; /* lower case */
    return (character >= 'a' && character <= 'f') ? (uint8_t)(character - 'a' + 10) : (uint8_t)NO_DIGIT;
}

static void store(hex_reader_t *reader, uint32_t offset, uint8_t byte)
{
    /* The two halves one by one: their sum may not fit into 32 bits. */
    if (reader->base >= NODE_PROGRAM_SIZE || offset >= NODE_PROGRAM_SIZE - reader->base) {
        reader->flawed = true;
    } else {
        const uint16_t address = (uint16_t)(reader->base + offset);
        const uint8_t bit = (uint8_t)(1u << (address & 7u));
        if ((reader->used[address >> 3] & bit) != 0u) {
            reader->doubled = true;
        } else {
            reader->used[address >> 3] |= bit;
            ++reader->stored;
        }
        reader->image[address] = byte;
    }
}

static uint8_t count_of(uint8_t type)
{
    switch (type) {
    case SEGMENT:
    case LINEAR:
        return 2u;
    case SEGMENT_ENTRY:
    case LINEAR_ENTRY:
        return 4u;
    default:
        return 0u;
    }
}

/* Applies a complete record. */
static bool finish(hex_reader_t *reader)
{
    reader->position = 0u;
    if (reader->flawed || reader->sum != 0u || reader->type > LINEAR_ENTRY) {
        return false;
    }
    if (reader->type == DATA) {
        return true;
    }
    if (reader->count != count_of(reader->type)) {
        return false;
    }
    if (reader->type == SEGMENT) {
        reader->base = reader->number << 4;
    } else if (reader->type == LINEAR) {
        reader->base = reader->number << 16;
    } else if (reader->type == END) {
        reader->ended = true;
        return !reader->doubled;
    } else {
        /* The start address is ignored. */
    }
    return true;
}

static bool take_byte(hex_reader_t *reader, uint16_t index, uint8_t byte)
{
    reader->sum = (uint8_t)(reader->sum + byte);
    if (index == COUNT_AT) {
        reader->count = byte;
        return !reader->flawed; /* without a count the end of the record is unknown */
    }
    if (index == OFFSET_AT || index == OFFSET_LOW_AT) {
        reader->offset = (uint16_t)((uint16_t)(reader->offset << 8) | byte);
    } else if (index == TYPE_AT) {
        reader->type = byte;
    } else if (index < (uint16_t)(DATA_AT + reader->count)) {
        reader->number = (reader->number << 8) | byte;
        if (reader->type == DATA) {
            store(reader, (uint32_t)reader->offset + (index - DATA_AT), byte);
        }
    } else {
        return finish(reader);
    }
    return true;
}

static bool begin(hex_reader_t *reader, uint8_t character)
{
    if (character == ' ' || character == '\t' || character == '\r' || character == '\n') {
        return true;
    }
    reader->position = 1u;
    reader->sum = 0u;
    reader->number = 0u;
    reader->flawed = false;
    return character == ':' && !reader->ended;
}

bool hex_reader_take(hex_reader_t *reader, uint8_t character)
{
    const uint16_t position = reader->position;
    uint8_t digit;

    if (position == 0u) {
        return begin(reader, character);
    }
    digit = digit_of(character);
    if (digit == NO_DIGIT) {
        reader->flawed = true;
    }
    reader->position = (uint16_t)(position + 1u);
    if ((position & 1u) != 0u) {
        reader->high = digit;
        return true;
    }
    return take_byte(reader, (uint16_t)(position / 2u - 1u), (uint8_t)((uint8_t)(reader->high << 4) | digit));
}
