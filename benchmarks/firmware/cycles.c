/*
 * Cycles on the AVR, for run_cycles: receiving each byte of a frame, and encoding one. FRAME selects the frame: 0 a
 * motion response without stuffed bytes, 1 one with every data byte stuffed; 2 and 3 likewise for the longest motion
 * request; 4 a slave that answers frame 2 with frame 1; 5 the same for frame 3.
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "qlink.h"

/* run_cycles prints a line for each mark: one instruction of one cycle, with its value in a register already. */
#define MARK(number) __asm__ volatile("out %0, %1" : : "I"(_SFR_IO_ADDR(GPIOR0)), "r"((uint8_t)(number)) : "memory")
enum { BEGIN = 1, END, FRAME_END, ENCODE_BEGIN, ENCODE_END, ANSWER_BEGIN, ANSWER_END, WRONG };

#define STUFFED (FRAME == 1 || FRAME == 3 || FRAME == 5)
#define BYTE ((uint8_t)(STUFFED ? 0xA5u : 0x11u))
#define WORD ((uint16_t)((uint16_t)((uint16_t)BYTE << 8) | BYTE))

static qlink_receiver_t receiver;
static qlink_slave_t slave;
static uint8_t wire[QLINK_MAX_WIRE_SIZE];
static uint8_t answer[QLINK_MAX_WIRE_SIZE];

__attribute__((noinline)) qlink_event_t receive(uint8_t byte);
__attribute__((noinline)) qlink_event_t receive(uint8_t byte)
{
    return qlink_receive(&receiver, byte);
}

static void fill(qlink_motion_response_t *response)
{
    response->counter = BYTE;
    response->inputs = BYTE;
    response->position = (int32_t)(((uint32_t)WORD << 16) | WORD);
    response->motor_status = WORD;
    response->fifo_space = BYTE;
}

#if FRAME < 2
__attribute__((noinline)) int encode(const qlink_motion_response_t *message);
__attribute__((noinline)) int encode(const qlink_motion_response_t *message)
{
    return qlink_motion_response_to_frame(message, 3u, wire, sizeof wire);
}

static int make(void)
{
    qlink_motion_response_t message;
    int size;
    fill(&message);
    MARK(ENCODE_BEGIN);
    size = encode(&message);
    MARK(ENCODE_END);
    return size;
}
#else
__attribute__((noinline)) int encode(const qlink_motion_request_t *message);
__attribute__((noinline)) int encode(const qlink_motion_request_t *message)
{
    return qlink_motion_request_to_frame(message, 3u, wire, sizeof wire);
}

static int make(void)
{
    qlink_motion_request_t message;
    uint8_t index;
    int size;
    message.counter = BYTE;
    message.outputs = BYTE;
    message.segments_count = sizeof message.segments / sizeof message.segments[0];
    for (index = 0u; index < message.segments_count; ++index) {
        message.segments[index] = WORD;
    }
    MARK(ENCODE_BEGIN);
    size = encode(&message);
    MARK(ENCODE_END);
    return size;
}
#endif

static bool on_motion(qlink_slave_t *own, const qlink_motion_request_t *request, qlink_motion_response_t *response)
{
    (void)own;
    (void)request;
    fill(response);
    return true;
}

__attribute__((noinline)) size_t dispatch(const qlink_frame_t *frame);
__attribute__((noinline)) size_t dispatch(const qlink_frame_t *frame)
{
    return qlink_slave_dispatch(&slave, frame, answer, sizeof answer);
}

static void respond(void)
{
    const qlink_frame_t frame = qlink_receiver_frame(&receiver);
    size_t size;
    MARK(ANSWER_BEGIN);
    size = dispatch(&frame);
    MARK(ANSWER_END);
    if (size == 0u) {
        MARK(WRONG);
    }
}

int main(void)
{
    const int size = make();
    int index;
    slave.node = 3u;
    slave.motion = on_motion;
    qlink_receiver_init(&receiver);
    for (index = 0; index < size; ++index) {
        const uint8_t byte = wire[index];
        qlink_event_t event;
        MARK(BEGIN);
        event = receive(byte);
        MARK(END);
        if (event == QLINK_EVENT_FRAME) {
            MARK(FRAME_END);
        }
    }
    if (FRAME >= 4) {
        respond();
    }
    cli();
    sleep_mode();
    return 0;
}
