# Stellaris LM3S6965 (Cortex-M3). Debian: gcc-arm-none-eabi libnewlib-arm-none-eabi.
CC = arm-none-eabi-gcc
SIZE = arm-none-eabi-size
PORT_FLAGS = -mcpu=cortex-m3 -mthumb
PORT_SOURCES = lm3s6965evb/board.c lm3s6965evb/startup.c
# newlib is used only for the compiler's calls of memcpy and memset.
PORT_LDFLAGS = -nostartfiles --specs=nano.specs -T lm3s6965evb/lm3s6965.ld
APPS = qlink_node trio_keypad
APPS += $(if $(wildcard $(HEADERS)/qlink_master.h),qlink_master)
