
/* ---- @name@ ---- */
@fill@
/* Decodes random bytes; a decoded message is encoded to the same bytes, and decoded once more. */
static inline bool @f@_again_(const uint8_t *bytes, size_t size)
{
    @type@ first@zero@;
    @type@ second@zero@;
    uint8_t again[@C@_MAX_SIZE + 1u];
    uint8_t once_more[@C@_MAX_SIZE + 1u];
    int written;
    if (@get_first@ != @P@_OK) { return false; }
    written = @put_first@;
    REQUIRE(written >= 0 && (size_t)written <= @C@_MAX_SIZE);
    if (@exact@) { REQUIRE((size_t)written == size && memcmp(again, bytes, size) == 0); }
    REQUIRE(@get_second@ == @P@_OK);
    REQUIRE(@put_second@ == written && memcmp(again, once_more, (size_t)written) == 0);
    (void)first;
    (void)second;
    return true;
}

/* Builds a frame of random values. */
static inline int @f@_made_(input_t *input, uint64_t whom, uint8_t *wire, size_t capacity)
{
    @type@ message@zero@;
@fill_message@
    (void)input;
    (void)message;
    (void)whom;
    return @to_frame@;
}

/* Encodes random values for a random address and capacity; an encoded message can be decoded. */
static inline void @f@_any_(input_t *input)
{
    @type@ message@zero@;
    const size_t capacity = take_capacity(input, @C@_MAX_WIRE_SIZE);
    const uint64_t whom = take_number(input, @whom_size@u);
    uint8_t *const wire = room(capacity);
    input_t values = *input;
    int size;
@fill_message@
    size = @put_any@;
    REQUIRE(size <= (int)capacity && (size < 0 || @f@_again_(wire, (size_t)size)));
    size = @f@_made_(&values, whom, wire, capacity);
    REQUIRE(size <= (int)capacity);
    if (size >= 0) { REQUIRE(@taken_apart@); }
    release(wire);
@scales@
    (void)message;
}
