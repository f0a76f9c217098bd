/* The invariant of a receiver of marked frames (receiver_marked). There are never more bytes than the buffer takes.
 * Inside a frame, the bytes that may stand between header and end are payload and check value, and where there is a
 * check value it is among the fewest that must stand there. */
static bool inside(const @p@_receiver_t *receiver)
{
    return receiver->state == @P@_INSIDE_;
}

static bool holds(const @p@_receiver_t *receiver)
{
    const size_t check = receiver->checked ? @check@u : 0u;
    return receiver->state <= @P@_REFUSED_ && receiver->count <= sizeof receiver->buffer && (!inside(receiver) ||
        (receiver->least >= check && receiver->most <= @P@_MAX_PAYLOAD_SIZE + check));
}

static void reached_before(const @p@_receiver_t *receiver)
{
    REACHED(receiver->state == @P@_IDLE_);
    REACHED(receiver->state == @P@_HUNTING_);
    REACHED(receiver->state == @P@_INSIDE_);
    REACHED(receiver->state == @P@_REFUSED_);
    REACHED(inside(receiver) && receiver->count == sizeof receiver->buffer);
}

static void reached_after(const @p@_receiver_t *receiver, @p@_event_t event)
{
    REACHED(event == @P@_EVENT_NONE);
    REACHED(event == @P@_EVENT_FRAME && receiver->checked);
    REACHED(event == @P@_EVENT_FRAME && !receiver->checked);
    REACHED(event == @P@_EVENT_FRAME && @p@_receiver_frame(receiver).size == @P@_MAX_PAYLOAD_SIZE);
    REACHED(event == @P@_EVENT_CRC);
    REACHED(event == @P@_EVENT_FRAMING);
}
