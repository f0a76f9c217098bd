#include "display.h"

#include <string.h>

#define CLEAR 12u
#define HOME 14u
#define HIDE 20u
#define ESCAPE 27u
#define GO 72u
#define RETURN 13u
#define LINE_FEED 10u

static void clear(display_t *display)
{
    memset(display->cells, ' ', sizeof display->cells);
    display->place = 0u;
}

void display_start(display_t *display)
{
    clear(display);
    display->cursor_visible = true;
    display->escape = 0u;
    display->ignored = 0u;
}

static void move(display_t *display, unsigned by)
{
    display->place = (uint8_t)((display->place + by) % DISPLAY_CELLS);
}

static void control(display_t *display, uint8_t character)
{
    switch (character) {
    case CLEAR:
        clear(display);
        break;
    case HOME:
        display->place = 0u;
        break;
    case HIDE:
        display->cursor_visible = false;
        break;
    case ESCAPE:
        display->escape = 1u;
        break;
    case RETURN:
        display->place = (uint8_t)(display->place - display->place % KEYPAD_COLUMNS);
        break;
    case LINE_FEED:
        move(display, KEYPAD_COLUMNS);
        break;
    default:
        ++display->ignored;
        break;
    }
}

/* A character after ESCAPE. */
static void sequence(display_t *display, uint8_t character)
{
    if (display->escape == 1u && character == GO) {
        display->escape = 2u;
        return;
    }
    if (display->escape == 2u && character < DISPLAY_CELLS) {
        display->place = character;
    } else {
        ++display->ignored;
    }
    display->escape = 0u;
}

void display_feed(display_t *display, const uint8_t *characters, size_t count)
{
    for (size_t index = 0u; index < count; ++index) {
        const uint8_t character = characters[index];
        if (display->escape != 0u) {
            sequence(display, character);
        } else if (character >= 32u && character <= 126u) {
            display->cells[display->place] = character;
            move(display, 1u);
        } else {
            control(display, character);
        }
    }
}
