
/* ---- Target decoders: @p@ ---- */

/* By message; by size (too short, the longest, too long) and address, or for a response with its checksum; by status. */
OUTCOMES static uint8_t @p@_outcomes_[@messages@u + 1u][7][10];

/* Any bytes as the payload of any message. */
static void @p@_payload_(input_t *input)
{
    const bool answer = (take(input) & 1u) != 0u;
    const uint8_t id = take(input);
    const uint64_t whom = take_number(input, @address_size@u);
    const unsigned found = @p@_find_(answer, id);
    uint8_t *const bytes = copy(input->at, input->left);
    @p@_frame_t frame;
    size_t class_;
    int status;
    bool decoded;
    (void)whom;
    frame.@id@ = id;
@set_address@
    frame.size = input->left;
    frame.payload = bytes;
    status = answer ? @p@_@second@_check(&frame) : @p@_@first@_check(&frame);
    class_ = (input->left < @p@_most_(found)) ? 0u : (input->left == @p@_most_(found)) ? 1u : 2u;
    @p@_outcomes_[found][class_ + ((whom == 0u) ? 3u : 0u)][-status] = 1u;
    decoded = @p@_again_(found, bytes, input->left);
    REQUIRE(decoded || status != @P@_OK);
    release(bytes);
}

/* Any bytes as a whole frame. */
static void @p@_wire_(input_t *input)
{
    const bool answer = (take(input) & 1u) != 0u;
    uint8_t *const wire = copy(input->at, input->left);
    (void)@p@_whole_(answer, wire, input->left);
@sums@
    release(wire);
}

/* Any values in any message, and any number as one of each enum. */
static void @p@_values_(input_t *input)
{
    const bool answer = (take(input) & 1u) != 0u;
    const uint8_t id = take(input);
    (void)@p@_any_(@p@_find_(answer, id), input);
@enums@
}
@parts@
static void @p@_decoders_(input_t *input)
{
    switch (take(input) % 4u) {
    case 0u: @p@_payload_(input); break;
    case 1u: @p@_wire_(input); break;
    case 2u: @p@_values_(input); break;
    default: @parts_call@ break;
    }
}
