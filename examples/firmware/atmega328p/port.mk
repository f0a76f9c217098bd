# An ATmega328P with a crystal of F_CPU hertz, avr-gcc and avr-libc.
CC = avr-gcc
SIZE = avr-size
F_CPU ?= 14745600UL
APPS = qlink_node
PORT_SOURCES = atmega328p/board.c
PORT_FLAGS = -mmcu=atmega328p -DF_CPU=$(F_CPU)
# Of the forms of the CRC the table is the fast one; it is in flash, once.
PORT_FLAGS += -DQLINK_CRC_FORM=QLINK_CRC_FORM_TABLE -DQLINK_CRC_SHARED_TABLE
# Variables get what the stack leaves of 2048 bytes of RAM. It is measured by the benchmarks; an interrupt comes on top.
PORT_LDFLAGS = -Wl,--defsym=__DATA_REGION_LENGTH__=1728
