/*
 * Board: Stellaris LM3S6965 (Cortex-M3, 50 MHz), for example its evaluation board, QEMU machine lm3s6965evb.
 * Register and bit names as in the data sheet.
 *
 * The FIFO of the UART is off: it reports a single byte only after 32 bit times, and a Q.link slave has to answer
 * within 30. Without the FIFO every byte interrupts at once, and has to be read before the next one is complete.
 */
#include "board.h"

#include "line.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define SYSCTL_RIS REGISTER(0x400FE050u)
#define SYSCTL_RCC REGISTER(0x400FE060u)
#define SYSCTL_RCGC1 REGISTER(0x400FE104u)
#define SYSCTL_RCGC2 REGISTER(0x400FE108u)
#define RIS_PLLLRIS (1u << 6)
#define RCC_MOSCDIS (1u << 0)
#define RCC_OSCSRC (3u << 4)
#define RCC_XTAL (15u << 6)
#define RCC_XTAL_8MHZ (14u << 6)
#define RCC_BYPASS (1u << 11)
#define RCC_PWRDN (1u << 13)
#define RCC_USESYSDIV (1u << 22)
#define RCC_SYSDIV (15u << 23)
#define RCC_SYSDIV_4 (3u << 23)
#define RCGC1_UART0 (1u << 0)
#define RCGC2_PORTS 0x33u /* A, B, E, F */

#define UART_DR REGISTER(0x4000C000u)
#define UART_FR REGISTER(0x4000C018u)
#define UART_IBRD REGISTER(0x4000C024u)
#define UART_FBRD REGISTER(0x4000C028u)
#define UART_LCRH REGISTER(0x4000C02Cu)
#define UART_CTL REGISTER(0x4000C030u)
#define UART_IM REGISTER(0x4000C038u)
#define DR_FE (1u << 8)
#define DR_BE (1u << 10)
#define DR_OE (1u << 11)
#define FR_BUSY (1u << 3)
#define FR_RXFE (1u << 4)
#define FR_TXFF (1u << 5)
#define LCRH_WLEN_8 (3u << 5)
#define CTL_UARTEN (1u << 0)
#define CTL_TXE (1u << 8)
#define CTL_RXE (1u << 9)
#define IM_RX (1u << 4)

#define PORT_A 0x40004000u
#define PORT_B 0x40005000u
#define PORT_E 0x40024000u
#define PORT_F 0x40025000u
/* The address selects the pins of an access: no read-modify-write for the others. */
#define GPIO_DATA(port, pins) REGISTER((port) + ((uint32_t)(pins) << 2))
#define GPIO_DIR(port) REGISTER((port) + 0x400u)
#define GPIO_AFSEL(port) REGISTER((port) + 0x420u)
#define GPIO_PUR(port) REGISTER((port) + 0x510u)
#define GPIO_DEN(port) REGISTER((port) + 0x51Cu)

#define SYST_CSR REGISTER(0xE000E010u)
#define SYST_RVR REGISTER(0xE000E014u)
#define SYST_CVR REGISTER(0xE000E018u)
#define NVIC_ISER0 REGISTER(0xE000E100u)
#define IRQ_UART0 (1u << 5)

/* Wiring. */
#define PIN_RX 0x01u        /* PA0 */
#define PIN_TX 0x02u        /* PA1 */
#define PIN_DIRECTION 0x01u /* PB0: high while sending; 10 kOhm to ground at DE hold it low until then */
#define PIN_BUTTONS 0x0Fu   /* PE0 to PE3: inputs 1 to 4, low when pressed */
#define PIN_SELECT 0x02u    /* PF1: input 5, low when pressed */
#define PIN_LEDS 0x0Du      /* PF0, PF2, PF3: outputs 1 to 3 */

#define CLOCK 50000000ul
#define DIVISOR ((8u * CLOCK / BOARD_BAUD + 1u) / 2u) /* of 16 times the baud, in steps of 1/64 */
#define CLOCKS_64 (4u * CLOCK) /* 64 steps of the divisor, 16 times the baud: DIVISOR * baud, for an exact rate */
#if DIVISOR < 64u || DIVISOR > 4194303u
#error "BOARD_BAUD does not fit the divider of the UART: 48 to 3125000 baud"
#elif 50u * DIVISOR * BOARD_BAUD > 51u * CLOCKS_64 || 50u * DIVISOR * BOARD_BAUD < 49u * CLOCKS_64
#error "BOARD_BAUD cannot be made from 50 MHz within 2 %"
#endif

#define TICK_CLOCKS (CLOCK / 1000u)

static volatile uint8_t ring[256]; /* its indices wrap without a modulo */
static volatile uint8_t head;
static volatile uint8_t tail;
static volatile uint16_t overruns;
static volatile uint32_t milliseconds;

static void start_clock(void)
{
    SYSCTL_RCC = (SYSCTL_RCC | RCC_BYPASS) & ~(RCC_USESYSDIV | RCC_MOSCDIS);
    for (volatile uint32_t settle = 0u; settle < 0x8000u; ++settle) { /* the crystal starts within some milliseconds */
    }
    SYSCTL_RCC = (SYSCTL_RCC & ~(RCC_XTAL | RCC_OSCSRC | RCC_PWRDN)) | RCC_XTAL_8MHZ;
    SYSCTL_RCC = (SYSCTL_RCC & ~RCC_SYSDIV) | RCC_SYSDIV_4 | RCC_USESYSDIV; /* 200 MHz / 4 */
    while ((SYSCTL_RIS & RIS_PLLLRIS) == 0u) {
    }
    SYSCTL_RCC &= ~RCC_BYPASS;
    SYST_RVR = TICK_CLOCKS - 1u;
    SYST_CVR = 0u;
    SYST_CSR = 7u; /* on, interrupt, processor clock */
}

static void start_pins(void)
{
    SYSCTL_RCGC2 |= RCGC2_PORTS;
    (void)SYSCTL_RCGC2; /* a port needs three clocks after it is enabled */
    GPIO_DATA(PORT_B, PIN_DIRECTION) = 0u;
    GPIO_DIR(PORT_B) |= PIN_DIRECTION;
    GPIO_DEN(PORT_B) |= PIN_DIRECTION;
    GPIO_PUR(PORT_E) |= PIN_BUTTONS;
    GPIO_DEN(PORT_E) |= PIN_BUTTONS;
    GPIO_PUR(PORT_F) |= PIN_SELECT;
    GPIO_DIR(PORT_F) |= PIN_LEDS;
    GPIO_DEN(PORT_F) |= PIN_SELECT | PIN_LEDS;
}

static void start_uart(void)
{
    SYSCTL_RCGC1 |= RCGC1_UART0;
    (void)SYSCTL_RCGC1;
    UART_IBRD = DIVISOR / 64u;
    UART_FBRD = DIVISOR % 64u;
    UART_LCRH = LCRH_WLEN_8;
    UART_IM = IM_RX;
    UART_CTL = CTL_UARTEN | CTL_TXE | CTL_RXE;
    GPIO_PUR(PORT_A) |= PIN_RX; /* RO of the driver floats while /RE is high */
    GPIO_AFSEL(PORT_A) |= PIN_RX | PIN_TX;
    GPIO_DEN(PORT_A) |= PIN_RX | PIN_TX;
    NVIC_ISER0 = IRQ_UART0;
}

void board_start(void)
{
    start_pins(); /* first, since the clock takes milliseconds: the driver is off from now on */
    start_clock();
    start_uart();
}

/* Reading DR is the acknowledgement. If the ring is full, the byte waits in the UART until board_receive. A byte
 * without stop bit is dropped: its frame is lost, and the receiver finds the next one. */
void uart0_interrupt(void)
{
    while ((UART_FR & FR_RXFE) == 0u) {
        uint32_t data;
        if ((uint8_t)(head + 1u) == tail) {
            UART_IM = 0u;
            break;
        }
        data = UART_DR;
        if ((data & DR_OE) != 0u && overruns != UINT16_MAX) {
            ++overruns; /* overrun: a byte was received before the last one was read */
        }
        if ((data & (DR_FE | DR_BE)) == 0u) {
            ring[head] = (uint8_t)data;
            ++head;
        }
    }
}

void systick_interrupt(void)
{
    ++milliseconds;
}

bool board_receive(uint8_t *byte)
{
    if (tail == head) {
        return false;
    }
    *byte = ring[tail];
    ++tail;
    UART_IM = IM_RX; /* the ring has room again */
    return true;
}

static void wait_microseconds(uint32_t duration)
{
    uint32_t before = SYST_CVR;
    uint32_t left = duration * (CLOCK / 1000000u);
    while (left > 0u) {
        const uint32_t now = SYST_CVR; /* counts down to 0, then reloads */
        const uint32_t gone = before >= now ? before - now : before + TICK_CLOCKS - now;
        left -= gone < left ? gone : left;
        before = now;
    }
}

/* Waiting for the UART needs no timeout: it runs on the clock of the processor. */
void board_send(const uint8_t *bytes, size_t size)
{
    if (size == 0u) {
        return;
    }
    wait_microseconds(BOARD_TURNAROUND_US);
    board_driver(true);
    for (size_t index = 0u; index < size; ++index) {
        while ((UART_FR & FR_TXFF) != 0u) {
        }
        UART_DR = bytes[index];
    }
    while ((UART_FR & FR_BUSY) != 0u) { /* until the last stop bit is sent */
    }
    board_driver(false);
}

/* A masked interrupt wakes the processor all the same, and is taken after cpsie: none is lost in between. */
void board_wait(void)
{
    __asm volatile("cpsid i" ::: "memory");
    if (tail == head) {
        __asm volatile("wfi" ::: "memory");
    }
    __asm volatile("cpsie i" ::: "memory");
}

uint32_t board_milliseconds(void)
{
    return milliseconds;
}

uint32_t board_inputs(void)
{
    const uint32_t buttons = ~GPIO_DATA(PORT_E, PIN_BUTTONS) & PIN_BUTTONS;
    const uint32_t select = ~GPIO_DATA(PORT_F, PIN_SELECT) & PIN_SELECT;
    return buttons | (select << 3);
}

void board_outputs(uint32_t outputs)
{
    GPIO_DATA(PORT_F, PIN_LEDS) = (outputs & 1u) | ((outputs & 6u) << 1);
}

void board_driver(bool transmit)
{
    GPIO_DATA(PORT_B, PIN_DIRECTION) = transmit ? PIN_DIRECTION : 0u;
}

uint16_t board_overruns(void)
{
    return overruns;
}
