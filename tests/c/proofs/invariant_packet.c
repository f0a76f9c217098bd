/* The invariant of a receiver of bare packets (receiver_packet). Inside a packet, at least one byte is missing, and the
 * expected number of bytes fits the buffer. */
static bool holds(const @p@_receiver_t *receiver)
{
    return !receiver->inside ||
        (receiver->count < receiver->expected && receiver->expected <= @P@_MAX_PAYLOAD_SIZE);
}

static void reached_before(const @p@_receiver_t *receiver)
{
    REACHED(receiver->inside);
    REACHED(!receiver->inside);
    REACHED(receiver->inside && receiver->count == sizeof receiver->payload - 1u);
}

static void reached_after(const @p@_receiver_t *receiver, @p@_event_t event)
{
    REACHED(event == @P@_EVENT_NONE);
    REACHED(event == @P@_EVENT_FRAME && receiver->count == 0u);
    REACHED(event == @P@_EVENT_FRAME && receiver->count == @P@_MAX_PAYLOAD_SIZE);
    REACHED(event == @P@_EVENT_UNKNOWN);
}
