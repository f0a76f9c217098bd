
static const entry_t *find(const char *name)
{
    for (size_t index = 0u; name != NULL && index < sizeof entries / sizeof entries[0]; ++index) {
        if (strcmp(entries[index].name, name) == 0) { return &entries[index]; }
    }
    return NULL;
}

int main(void)
{
    while (fgets(line, LINE_SIZE, stdin) != NULL) {
        const char *command = strtok(line, " \n");
        const entry_t *entry;
        if (command == NULL) {
            printf("usage");
        } else if (strcmp(command, "stream") == 0) {
            stream(word());
        } else if (strcmp(command, "cuts") == 0) {
            cuts(word());
        } else if (strcmp(command, "check") == 0) {
            check(word());
        } else if ((entry = find(word())) == NULL) {
            printf("usage");
        } else if (strcmp(command, "encode") == 0) {
            entry->encode();
        } else if (strcmp(command, "decode") == 0) {
            entry->decode();
        } else if (strcmp(command, "payload") == 0) {
            entry->payload();
        } else {
            printf("usage");
        }
        putchar('\n');
        fflush(stdout);
    }
    return 0;
}
