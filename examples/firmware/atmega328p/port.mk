# An ATmega328P with a crystal of F_CPU hertz, avr-gcc and avr-libc.
CC = avr-gcc
SIZE = avr-size
F_CPU ?= 18432000UL
APPS = qlink_node
PORT_SOURCES = atmega328p/board.c
PORT_FLAGS = -mmcu=atmega328p -DF_CPU=$(F_CPU)
# Variables get 2048 bytes of RAM less the stack, as measured by the benchmarks; an interrupt comes on top.
PORT_LDFLAGS = -Wl,--defsym=__DATA_REGION_LENGTH__=1728
