/* A process as a board: its serial line is a pty; it prints the path. SIGTERM and SIGINT end it. */
#define _XOPEN_SOURCE 600

#include "board.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define BUFFER_SIZE 256u
#define TICK_MS 1
#define SEND_MS 100 /* without a reader for so long, the rest is dropped, as on a wire */

static int line = -1;
static struct timespec started;
static uint8_t buffer[BUFFER_SIZE]; /* received bytes; those that do not fit wait in the pty, so none is lost */
static size_t received;
static size_t taken;
static volatile sig_atomic_t stopping;

static void die(const char *what)
{
    perror(what);
    exit(EXIT_FAILURE);
}

static void on_stop(int number)
{
    (void)number;
    stopping = 1;
}

/* Raw mode: no echo, no translation of line ends, no signals. */
static void make_raw(int port)
{
    struct termios settings;
    if (tcgetattr(port, &settings) != 0) {
        die("tcgetattr");
    }
    settings.c_iflag = 0;
    settings.c_oflag = 0;
    settings.c_lflag = 0;
    settings.c_cflag = CS8 | CREAD | CLOCAL;
    settings.c_cc[VMIN] = 1;
    settings.c_cc[VTIME] = 0;
    if (tcsetattr(port, TCSANOW, &settings) != 0) {
        die("tcsetattr");
    }
}

static void open_line(void)
{
    const char *path;
    int port;
    line = posix_openpt(O_RDWR | O_NOCTTY);
    if (line < 0 || grantpt(line) != 0 || unlockpt(line) != 0 || (path = ptsname(line)) == NULL) {
        die("pty");
    }
    /* This end of the pty is never closed: the line does not hang up when a master closes its end. */
    port = open(path, O_RDWR | O_NOCTTY);
    if (port < 0) {
        die(path);
    }
    make_raw(port);
    if (fcntl(line, F_SETFL, O_NONBLOCK) != 0) {
        die("fcntl");
    }
    (void)printf("%s\n", path);
    (void)fflush(stdout);
}

void board_start(void)
{
    struct sigaction action = { .sa_handler = on_stop };
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    (void)clock_gettime(CLOCK_MONOTONIC, &started);
    open_line();
}

bool board_receive(uint8_t *byte)
{
    if (taken == received) {
        return false;
    }
    *byte = buffer[taken];
    ++taken;
    return true;
}

/* poll takes the place of an interrupt: the pty keeps a byte received before it. */
void board_wait(void)
{
    struct pollfd waiting = { .fd = line, .events = POLLIN };
    if (stopping) {
        exit(EXIT_SUCCESS);
    }
    if (taken == received && poll(&waiting, 1, TICK_MS) > 0) {
        const ssize_t size = read(line, buffer, sizeof buffer);
        received = (size > 0) ? (size_t)size : 0u;
        taken = 0u;
    }
}

void board_send(const uint8_t *bytes, size_t size)
{
    struct pollfd waiting = { .fd = line, .events = POLLOUT };
    if (size == 0u) {
        return;
    }
    board_driver(true);
    while (size > 0u && poll(&waiting, 1, SEND_MS) > 0) {
        const ssize_t sent = write(line, bytes, size);
        if (sent > 0) {
            bytes += sent;
            size -= (size_t)sent;
        } else if (errno != EAGAIN && errno != EINTR) {
            die("write");
        } else {
            /* once more */
        }
    }
    board_driver(false);
}

uint32_t board_milliseconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((now.tv_sec - started.tv_sec) * 1000 + (now.tv_nsec - started.tv_nsec) / 1000000);
}

uint32_t board_inputs(void)
{
    return 0u;
}

void board_outputs(uint32_t outputs)
{
    (void)outputs;
}

void board_driver(bool transmit)
{
    (void)transmit; /* a pty is full duplex */
}

uint16_t board_overruns(void)
{
    return 0u;
}
