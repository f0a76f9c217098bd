@callbacks@
static void @p@_listen_(input_t *input)
{
    @p@_@listener@_t listener;
    @p@_frame_t frame;
    unsigned calls = 0u;
    const bool interested = (take(input) & 7u) != 7u;
    uint8_t *bytes;
    int status;
    memset(&listener, 0, sizeof listener);
    listener.context = &calls;
    if (interested) {
@members@
    }
    frame.@id@ = take(input);
@set_address@
    frame.size = input->left;
    bytes = copy(input->at, input->left);
    frame.payload = bytes;
    status = @p@_@listener@_dispatch(&listener, &frame);
    REQUIRE(status == @p@_@second@_check(&frame));
    REQUIRE(calls == ((status == @P@_OK && interested) ? 1u : 0u));
    release(bytes);
}
