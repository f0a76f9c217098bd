/* Runs a firmware on a simulated ATmega328P until it sleeps with interrupts off: copies the output of its UART to the
 * standard output, and exits with the low bits of GPIOR0. */
#include <sim_avr.h>
#include <avr_uart.h>
#include <sim_elf.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

#define GPIOR0 0x3E
#define ENDED 0xA0 /* the firmware has come to its end */

static void sent(struct avr_irq_t *irq, uint32_t byte, void *context)
{
    (void)irq;
    (void)putc((int)(byte & 0xFFu), (FILE *)context);
}

int main(int argc, char **argv)
{
    elf_firmware_t firmware = {{0}};
    uint32_t flags = 0; /* simavr neither echoes lines itself nor sleeps while the firmware polls */
    FILE *const out = fdopen(dup(STDOUT_FILENO), "w");
    int state;
    avr_t *avr;
    (void)dup2(STDERR_FILENO, STDOUT_FILENO); /* simavr prints to it as well */
    avr = avr_make_mcu_by_name("atmega328p");
    if (argc != 2 || out == NULL || avr == NULL || elf_read_firmware(argv[1], &firmware) != 0) {
        (void)fprintf(stderr, "usage: avr_run FIRMWARE.elf, with a simavr that knows the atmega328p\n");
        return 2;
    }
    (void)avr_init(avr);
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    (void)avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, out);
    do {
        state = avr_run(avr);
    } while (state != cpu_Done && state != cpu_Crashed);
    (void)fclose(out);
    if (state == cpu_Crashed || (avr->data[GPIOR0] & 0xF0) != ENDED) {
        (void)fprintf(stderr, "avr_run: the firmware crashed, or slept without a result\n");
        return 3;
    }
    return avr->data[GPIOR0] & 0x0F;
}
