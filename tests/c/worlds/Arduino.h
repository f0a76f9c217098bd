/* What the examples use of Arduino. */
#include <stddef.h>
#include <stdint.h>
struct Port {
    void begin(unsigned long baud);
    int available();
    int read();
    size_t write(const uint8_t *bytes, size_t size);
};
extern Port Serial;
void setup();
void loop();
