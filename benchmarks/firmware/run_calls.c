/*
 * Runs a program for an ATmega328P in simavr to its end; prints the cycles of each call of some functions.
 *
 *   run_calls program.elf ADDRESS...
 *
 * Call and return are included. The program ends by `cli` and `sleep`. Status 1: it crashed, or ran too long.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <sim_avr.h>
#include <sim_elf.h>

#define LONGEST 50000000u /* cycles: the limit for a program that does not end */

int main(int count, char **words)
{
    static elf_firmware_t firmware;
    avr_t *avr;
    avr_cycle_count_t begun = 0;
    avr_flashaddr_t back = 0;
    int state = cpu_Running;

    if (count < 3 || elf_read_firmware(words[1], &firmware) != 0) {
        fprintf(stderr, "usage: run_calls PROGRAM.elf ADDRESS...\n");
        return 2;
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if (avr == NULL) {
        fprintf(stderr, "run_calls: this simavr has no atmega328p\n");
        return 2;
    }
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    while (state != cpu_Done && state != cpu_Crashed && avr->cycle < LONGEST) {
        const avr_cycle_count_t before = avr->cycle;
        const avr_flashaddr_t from = avr->pc;
        state = avr_run(avr);
        for (int at = 2; at < count && back == 0; ++at) {
            if (avr->pc == strtoul(words[at], NULL, 10) && from != avr->pc) {
                begun = before;
                back = from + 4; /* a call takes four bytes, a jump to the function is none */
            }
        }
        if (back != 0 && avr->pc == back) {
            printf("%llu\n", (unsigned long long)(avr->cycle - begun));
            back = 0;
        }
    }
    return state == cpu_Done ? EXIT_SUCCESS : EXIT_FAILURE;
}
