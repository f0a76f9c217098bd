/* The work of the comparison: receive a motion response, change it, send it. SIZE: the program whose flash and stack
 * count. Otherwise one message is encoded and received, for the count of instructions or cycles: `encode` and `receive`
 * are found in the trace by their names. EMPTY: the same without any of it. */
#include "compared.h"

#if defined(FLOOR)
#define VALUE(message, name) (message).name
#else
#define VALUE(message, name) (message).values.name
#endif

static volatile uint8_t port;

void send(const uint8_t *bytes, int size);
__attribute__((noinline)) void send(const uint8_t *bytes, int size)
{
    while (size-- > 0) {
        port = *bytes++;
    }
}

#if defined(SIZE)
int main(void)
{
#if defined(EMPTY)
    for (;;) {
        send((const uint8_t *)0x100, port);
    }
#else
    start();
    for (;;) {
        message_t message;
        if (receive_message(&message, port)) {
            VALUE(message, counter)++;
            send(wire, encode_message(&message));
        }
    }
#endif
}
#else
static message_t message;

int encode(const message_t *message);
__attribute__((noinline)) int encode(const message_t *message)
{
    return encode_message(message);
}

bool receive(message_t *message, uint8_t byte);
__attribute__((noinline)) bool receive(message_t *message, uint8_t byte)
{
    return receive_message(message, byte);
}

void run(void);
void run(void)
{
    int size;
    message.node = 3;
    VALUE(message, counter) = 0x11;
    VALUE(message, inputs) = 0x11;
    VALUE(message, position) = 0x11111111;
    VALUE(message, motor_status) = 0x1111;
    VALUE(message, fifo_space) = 0x11;
    start();
    size = encode(&message);
    for (int at = 0; at < size; ++at) {
        port = receive(&message, wire[at]);
    }
}

#if defined(__AVR__)
#include <avr/interrupt.h>
#include <avr/sleep.h>

int main(void)
{
    run();
    cli();
    sleep_mode();
    return 0;
}
#else
/* A Cortex-M without a library: its vectors, and the semihosting call that ends the emulator. */
void reset(void);
void reset(void)
{
    run();
    __asm__ volatile("movs r0, #0x18\n ldr r1, =0x20026\n bkpt 0xab");
}

extern const void *const vectors[2];
__attribute__((section(".vectors"))) const void *const vectors[2] = {(const void *)0x20010000, (const void *)reset};
#endif
#endif
