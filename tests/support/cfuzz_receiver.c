
/* ---- Target receiver: @p@ ---- */

static void @p@_delivered_(bool answer, const @p@_receiver_t *receiver)
{
    const @p@_frame_t frame = @p@_receiver_frame(receiver);
    volatile uint8_t sum = 0u;
    (void)answer;
    REQUIRE(frame.size <= @P@_MAX_PAYLOAD_SIZE);
    for (size_t index = 0u; index < frame.size; ++index) { sum = (uint8_t)(sum + frame.payload[index]); }
    (void)sum;
@delivered@
}

/* A frame passes through the box to the main loop, and from there byte by byte to the wire. */
static void @p@_boxed_(const @p@_receiver_t *receiver)
{
    static @p@_inbox_t inbox;
    static @p@_outbox_t outbox;
    const @p@_frame_t frame = @p@_receiver_frame(receiver);
    const size_t size = (frame.size < sizeof outbox.wire) ? frame.size : sizeof outbox.wire;
    const @p@_frame_t *kept;
    uint8_t byte = 0u;
    REQUIRE(@p@_inbox_frame(&inbox) == NULL);
    REQUIRE(@p@_inbox_put(&inbox, &frame));
    REQUIRE(!@p@_inbox_put(&inbox, &frame));
    kept = @p@_inbox_frame(&inbox);
    REQUIRE(kept != NULL && kept->size == frame.size && kept->payload != frame.payload);
    for (size_t index = 0u; index < size; ++index) { outbox.wire[index] = kept->payload[index]; }
    @p@_outbox_start(&outbox, size);
    for (size_t index = 0u; index < size; ++index) {
        REQUIRE(@p@_outbox_next(&outbox, &byte) && byte == kept->payload[index]);
    }
    REQUIRE(!@p@_outbox_next(&outbox, &byte));
    @p@_inbox_clear(&inbox);
}

static void @p@_event_(bool answer, const @p@_receiver_t *receiver, @p@_event_t event)
{
    static @p@_event_counts_t counts;
    @p@_count_event(&counts, event);
    if (event == @P@_EVENT_FRAME) {
        @p@_delivered_(answer, receiver);
        @p@_boxed_(receiver);
    }
}

/* Whether a frame with this id was received. */
static bool @p@_fed_(bool answer, @p@_receiver_t *receiver, uint8_t byte, uint8_t id)
{
    @p@_event_t event;
    bool came;
    REQUIRE(@p@_receive_bytes(receiver, &byte, 1u, &event) == 1u);
    came = event == @P@_EVENT_FRAME && @p@_receiver_frame(receiver).@id@ == id;
    @p@_event_(answer, receiver, event);
@next@
    return came;
}

OUTCOMES static uint8_t @p@_ahead_[1];

static void @p@_receiver_(input_t *input)
{
    const bool answer = (take(input) & 1u) != 0u;
    const uint8_t id = take(input);
    const unsigned last = @p@_find_(answer, id);
    input_t content = *input;
    @p@_receiver_t *const receiver = (@p@_receiver_t *)room(sizeof *receiver);
    uint8_t wire[@P@_MAX_WIRE_SIZE];
    bool came = false;
    int size;
    @p@_receiver_init(receiver@init@);
    while (input->left != 0u) { (void)@p@_fed_(answer, receiver, take(input), id); }
@finish@
    /* An intact frame is delivered after any input. */
    size = @p@_made_(last, &content, @lawful@u, wire, sizeof wire);
    for (int index = 0; index < size; ++index) {
        came = @p@_fed_(answer, receiver, wire[index], id) || came;
        if (came && index + 1 < size) { @p@_ahead_[0] = 1u; }
    }
    REQUIRE(came || size < 0 || !(@promised@));
    release(receiver);
}
