/* The kit on an ATmega328P: the lines are written to its UART, the result to GPIOR0. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

void conformance_put(char character);
int KIT(void);

void conformance_put(char character)
{
    loop_until_bit_is_set(UCSR0A, UDRE0);
    UDR0 = (uint8_t)character;
}

int main(void)
{
    UBRR0 = 0u; /* as fast as it goes */
    UCSR0B = _BV(TXEN0);
    GPIOR0 = (uint8_t)(0xA0 | KIT());
    loop_until_bit_is_set(UCSR0A, UDRE0);
    cli();
    sleep_enable();
    sleep_cpu(); /* without interrupts this is the end */
    return 0;
}
