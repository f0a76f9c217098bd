
/* ---- Target dispatch: @p@ ---- */
@slave@@master@
static void @p@_dispatch_(input_t *input)
{
    if ((take(input) & 1u) != 0u) {
        @call_master@
    } else {
        @call_slave@
    }
}
