# A process on a pty: Linux, and macOS untested.
SIZE = size
SUFFIX =
APPS = qlink_node trio_keypad
PORT_SOURCES = posix/board.c
ifeq ($(shell uname),Darwin)
GC = -Wl,-dead_strip
endif
