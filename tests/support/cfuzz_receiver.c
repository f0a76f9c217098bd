
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

static void @p@_event_(bool answer, const @p@_receiver_t *receiver, @p@_event_t event)
{
    if (event == @P@_EVENT_FRAME) { @p@_delivered_(answer, receiver); }
}

/* Whether a frame with this id was received. */
static bool @p@_fed_(bool answer, @p@_receiver_t *receiver, uint8_t byte, uint8_t id)
{
    @p@_event_t event = @p@_receive(receiver, byte);
    bool came = event == @P@_EVENT_FRAME && @p@_receiver_frame(receiver).@id@ == id;
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
