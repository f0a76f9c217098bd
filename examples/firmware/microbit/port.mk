# BBC micro:bit, first version: nRF51822 (Cortex-M0). Debian: gcc-arm-none-eabi libnewlib-arm-none-eabi.
CC = arm-none-eabi-gcc
SIZE = arm-none-eabi-size
PORT_FLAGS = -mcpu=cortex-m0 -mthumb
PORT_SOURCES = microbit/board.c microbit/startup.c
# newlib is used only for the compiler's calls of memcpy and memset.
PORT_LDFLAGS = -nostartfiles --specs=nano.specs -T microbit/nrf51822.ld
# With -Os, the answer to the longest request begins 5 us too late.
CFLAGS ?= -O3 -g
APPS = qlink_node
APPS += $(if $(wildcard $(HEADERS)/qlink_master.h),qlink_master)
