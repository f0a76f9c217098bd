/* The proof of a receiver. @p@ and @P@ are replaced by the protocol's name; the invariant, `holds`, is defined in the
 * file for its kind of receiver. One step from any state that satisfies it is memory-safe and leads to such a state,
 * and the initial state satisfies it: together that is memory safety for streams of any length. */
#include "@p@.h"

#define LENGTH 16u

#ifdef REACHING
#define REACHED(condition) __CPROVER_cover(condition)
#else
#define REACHED(condition) (void)(condition)
#endif

uint8_t nondet_byte(void);
size_t nondet_size(void);
@p@_receiver_t nondet_receiver(void);

@invariant@

/* A frame has at most the size that frames may have, and every byte of it is in the receiver's buffer. */
static void delivered(const @p@_receiver_t *receiver)
{
    const @p@_frame_t frame = @p@_receiver_frame(receiver);
    const uint8_t *const store = receiver->@store@;
    __CPROVER_assert(frame.size <= @P@_MAX_PAYLOAD_SIZE, "a frame is no longer than frames may be");
    __CPROVER_assert(frame.payload >= store && frame.payload + frame.size <= store + sizeof receiver->@store@,
        "a frame lies inside the buffer");
}

void start(void)
{
    @p@_receiver_t receiver = nondet_receiver();
    @p@_receiver_init(&receiver);
    __CPROVER_assert(holds(&receiver), "a receiver starts in a state that satisfies the invariant");
}

void step(void)
{
    @p@_receiver_t receiver = nondet_receiver();
    @p@_event_t event;
    __CPROVER_assume(holds(&receiver));
    reached_before(&receiver);
    event = @p@_receive(&receiver, nondet_byte());
    __CPROVER_assert(holds(&receiver), "a step keeps the invariant");
    if (event == @P@_EVENT_FRAME) {
        delivered(&receiver);
    }
    reached_after(&receiver, event);
}

void stream(void)
{
    @p@_receiver_t receiver = nondet_receiver();
    size_t frames = 0u;
    size_t longest = 0u;
    @p@_receiver_init(&receiver);
    for (size_t index = 0u; index < LENGTH; ++index) {
        if (@p@_receive(&receiver, nondet_byte()) == @P@_EVENT_FRAME) {
            delivered(&receiver);
            ++frames;
            longest = (@p@_receiver_frame(&receiver).size > longest) ? @p@_receiver_frame(&receiver).size : longest;
        }
    }
    REACHED(frames == 2u);
    REACHED(longest == @P@_MAX_PAYLOAD_SIZE);
}
