#include "program_store.h"

static void begin(program_store_t *store, program_state_t state)
{
    hex_reader_init(&store->reader);
    store->state = state;
    store->begun = false;
    store->last = UINT8_MAX; /* the first piece has counter 0 */
}

void program_store_init(program_store_t *store)
{
    begin(store, PROGRAM_NONE);
}

static bool read(program_store_t *store, const uint8_t *text, uint8_t size)
{
    uint8_t index;
    for (index = 0u; index < size; ++index) {
        if (!hex_reader_take(&store->reader, text[index])) {
            store->state = PROGRAM_FAULT;
            return false;
        }
    }
    return true;
}

program_verdict_t program_store_take(program_store_t *store, uint8_t counter, const uint8_t *text, uint8_t size)
{
    if (counter == 0u && size == 0u) {
        begin(store, PROGRAM_LOADING);
        return PROGRAM_OPENED;
    }
    if (store->begun && counter == store->last) {
        return PROGRAM_REPEATED;
    }
    if (store->state == PROGRAM_NONE || store->state == PROGRAM_FAULT || counter != (uint8_t)(store->last + 1u) ||
        !read(store, text, size)) {
        return PROGRAM_REFUSED;
    }
    store->begun = true;
    store->last = counter;
    if (store->reader.ended) {
        store->state = PROGRAM_THERE;
    }
    return PROGRAM_STORED;
}
