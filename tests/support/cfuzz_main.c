
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input_t input = { data, size };
    switch (take(&input) % @parts@u) {
@cases@
    default: break;
    }
    return 0;
}

#ifdef REPLAY
/* Reads inputs as lines of hex digits, and runs each once. */
static int digit(int character)
{
    return (character >= '0' && character <= '9') ? character - '0'
        : (character >= 'a' && character <= 'f') ? character - 'a' + 10 : -1;
}

int main(void)
{
    static uint8_t bytes[65536];
    size_t size = 0u;
    unsigned long lines = 0u;
    int character;
    while ((character = getchar()) != EOF) {
        if (character == '\n') {
            uint8_t *const data = copy(bytes, size);
            (void)LLVMFuzzerTestOneInput(data, size);
            release(data);
            size = 0u;
            ++lines;
        } else {
            const int high = digit(character);
            const int low = digit(getchar());
            if (high < 0 || low < 0 || size == sizeof bytes) { return 2; }
            bytes[size++] = (uint8_t)(high * 16 + low);
        }
    }
    printf("%lu\n", lines);
    return 0;
}
#endif
