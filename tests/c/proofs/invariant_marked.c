/* The invariant of a receiver of marked frames (receiver_marked): the bytes received fit the buffer. */
static bool inside(const @p@_receiver_t *receiver)
{
    return receiver->state == @P@_INSIDE_;
}

static bool holds(const @p@_receiver_t *receiver)
{
    return receiver->state <= @P@_INSIDE_ && receiver->count <= sizeof receiver->buffer;
}

static void reached_before(const @p@_receiver_t *receiver)
{
    REACHED(receiver->state == @P@_IDLE_);
    REACHED(receiver->state == @P@_HUNTING_);
    REACHED(receiver->state == @P@_INSIDE_);
    REACHED(inside(receiver) && receiver->count == sizeof receiver->buffer);
}

static void reached_after(const @p@_receiver_t *receiver, @p@_event_t event)
{
    REACHED(event == @P@_EVENT_NONE);
    REACHED(event == @P@_EVENT_FRAME);
    REACHED(event == @P@_EVENT_FRAME && @p@_receiver_frame(receiver).size == @P@_MAX_PAYLOAD_SIZE);
    REACHED(event == @P@_EVENT_CRC);
    REACHED(event == @P@_EVENT_FRAMING);
}
