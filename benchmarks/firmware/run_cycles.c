/*
 * Runs a program for an ATmega328P in simavr to its end, and prints its marks.
 *
 *   run_cycles program.elf HERTZ
 *
 * The program writes the number of a mark to GPIOR0, which has no other use; a line for each is printed: the mark, the
 * clock cycle, the stack pointer, and its lowest value since the mark before. It ends by `cli` and `sleep`. Status 1:
 * it crashed, or ran too long.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <sim_avr.h>
#include <sim_elf.h>
#include <sim_io.h>

#define GPIOR0 0x3E /* address in data space */
#define SPL 0x5D
#define SPH 0x5E
#define LONGEST 50000000u /* cycles: the limit for a program that does not end */

static unsigned lowest = 0xFFFFu;

static unsigned stack_pointer(const avr_t *avr)
{
    return ((unsigned)avr->data[SPH] << 8) | avr->data[SPL];
}

static void marked(struct avr_t *avr, avr_io_addr_t address, uint8_t mark, void *context)
{
    (void)address;
    (void)context;
    printf("%u %llu %u %u\n", mark, (unsigned long long)avr->cycle, stack_pointer(avr), lowest);
    lowest = stack_pointer(avr);
}

int main(int count, char **words)
{
    static elf_firmware_t firmware;
    avr_t *avr;
    int state = cpu_Running;

    if (count != 3 || elf_read_firmware(words[1], &firmware) != 0) {
        fprintf(stderr, "usage: run_cycles PROGRAM.elf HERTZ\n");
        return 2;
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if (avr == NULL) {
        fprintf(stderr, "run_cycles: this simavr has no atmega328p\n");
        return 2;
    }
    avr_init(avr);
    firmware.frequency = (uint32_t)strtoul(words[2], NULL, 10);
    avr_load_firmware(avr, &firmware);
    avr_register_io_write(avr, GPIOR0, marked, NULL);
    while (state != cpu_Done && state != cpu_Crashed && avr->cycle < LONGEST) {
        state = avr_run(avr);
        lowest = stack_pointer(avr) < lowest ? stack_pointer(avr) : lowest;
    }
    return state == cpu_Done ? EXIT_SUCCESS : EXIT_FAILURE;
}
