/* The invariant of a receiver with a unique preamble (receiver_streamed). In the body, also after a stuffed byte: the
 * first byte is a length that frames may have, at least one byte is received and at least one is missing. In the
 * other states position and bytes may have any value: the next preamble restarts them. */
static bool inside(const @p@_receiver_t *receiver)
{
    return receiver->state == @P@_BODY_ || receiver->state == @P@_ESCAPE_;
}

static bool holds(const @p@_receiver_t *receiver)
{
    const size_t behind_length = (size_t)receiver->body[0];
    return receiver->state <= @P@_ESCAPE_ && (!inside(receiver) ||
        (behind_length >= @bias@u && behind_length <= @bias@u + @P@_MAX_PAYLOAD_SIZE &&
        receiver->position >= 1u && receiver->position <= behind_length));
}

static void reached_before(const @p@_receiver_t *receiver)
{
    REACHED(receiver->state == @P@_HUNTING_);
    REACHED(receiver->state == @P@_FIRST_);
    REACHED(receiver->state == @P@_PREAMBLE_);
    REACHED(receiver->state == @P@_BODY_);
    REACHED(receiver->state == @P@_ESCAPE_);
    REACHED(inside(receiver) && receiver->position == sizeof receiver->body - 1u);
}

static void reached_after(const @p@_receiver_t *receiver, @p@_event_t event)
{
    REACHED(event == @P@_EVENT_NONE);
    REACHED(event == @P@_EVENT_FRAME);
    REACHED(event == @P@_EVENT_FRAME && @p@_receiver_frame(receiver).size == @P@_MAX_PAYLOAD_SIZE);
    REACHED(event == @P@_EVENT_CRC);
    REACHED(event == @P@_EVENT_STUFFING);
    REACHED(event == @P@_EVENT_LENGTH);
    REACHED(event == @P@_EVENT_TRUNCATED);
}
