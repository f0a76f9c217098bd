typedef struct {
    input_t input;
    unsigned called;
    bool answers; /* the function accepted the request, and its response can be sent */
} @p@_context_t;
@handlers@
static void @p@_ask_(input_t *input)
{
    @p@_context_t context;
    @p@_slave_t slave;
    @p@_frame_t frame;
    const size_t capacity = take_capacity(input, @P@_MAX_WIRE_SIZE);
    const bool supported = (take(input) & 7u) != 7u;
    const size_t size = take(input);
    const uint8_t whose = take(input);
    uint8_t *const wire = room(capacity);
    uint8_t *bytes;
    size_t answer;
    bool lawful = true;
    memset(&slave, 0, sizeof slave);
    memset(&context, 0, sizeof context);
    frame.@id@ = take(input);
@whom@
    (void)whose;
    frame.size = (size < input->left) ? size : input->left;
    bytes = copy(input->at, frame.size);
    frame.payload = bytes;
    context.input.at = input->at + frame.size;
    context.input.left = input->left - frame.size;
    slave.context = &context;
    if (supported) {
@members@
    }
    answer = @p@_slave_dispatch(&slave, &frame, wire, capacity);
    REQUIRE(answer <= capacity && context.called <= 1u);
    if (context.called != 0u) { REQUIRE(@for_me@); }
    if (lawful && context.called != 0u) { REQUIRE(@p@_@first@_check(&frame) == @P@_OK); }
    if (context.called == 0u) { REQUIRE(answer == 0u || @rejects@); }
    if (context.called != 0u && !context.answers) { REQUIRE(answer == 0u); }
    if (lawful && context.answers && capacity == @P@_MAX_WIRE_SIZE) { REQUIRE(answer != 0u@silent@); }
    if (answer != 0u) {
        uint8_t *const exact = copy(wire, answer);
@answered@
        release(exact);
    }
    release(bytes);
    release(wire);
}
