/* Options of a build, each set by -DNAME=VALUE. Node number, delays and position type can also be set on the line. */
#ifndef OPTIONS_H
#define OPTIONS_H

#ifndef NODE_NUMBER
#define NODE_NUMBER 1 /* 1..16 */
#endif
#ifndef NODE_T1_TENTHS
#define NODE_T1_TENTHS 10 /* from input 1 going high to output 1 going high, 0..255 tenths of a second */
#endif
#ifndef NODE_T2_TENTHS
#define NODE_T2_TENTHS 10 /* the same for input 1 going low */
#endif
#ifndef NODE_POSITION_TYPE
#define NODE_POSITION_TYPE 0 /* QLINK_POSITION_TYPE_... */
#endif
#ifndef NODE_VERSION_MAJOR
#define NODE_VERSION_MAJOR 1
#endif
#ifndef NODE_VERSION_MINOR
#define NODE_VERSION_MINOR 0
#endif
#ifndef NODE_PRODUCT
#define NODE_PRODUCT 0 /* 0..65535 */
#endif
#ifndef NODE_SERIAL
#define NODE_SERIAL 0 /* 0..4294967295 */
#endif

#ifndef NODE_FIFO
#define NODE_FIFO 48 /* capacity in path words, 1..255; two bytes of RAM each */
#endif
#if NODE_FIFO < 1 || NODE_FIFO > 255
#error "NODE_FIFO must be 1 to 255: the motion's answer has one byte for the free words"
#endif

#ifndef NODE_RATE
/* Path words a second; 0 for a motor that never moves. The words of a millisecond are done at once, NODE_FIFO of them
 * at most, and an answer waits for them: on an 8-bit processor it can be late above some ten thousand words a
 * second. */
#define NODE_RATE 1000
#endif
#ifndef NODE_STARTED
#define NODE_STARTED 0 /* 1: the motor takes words after power-up and reset without a node_start */
#endif
#ifndef NODE_MOTOR_MS
#define NODE_MOTOR_MS 50 /* until the motor completes a request, 0..65535 */
#endif

#ifndef NODE_PROGRAM_SIZE /* bytes of a loaded program, from address 0 on; nine bits of RAM each */
#ifdef __AVR__
#define NODE_PROGRAM_SIZE 512
#else
#define NODE_PROGRAM_SIZE 4096
#endif
#endif
#if NODE_PROGRAM_SIZE < 1 || NODE_PROGRAM_SIZE > 32767
#error "NODE_PROGRAM_SIZE must be 1 to 32767"
#endif

#ifndef NODE_DIAGNOSTICS
#define NODE_DIAGNOSTICS 0 /* 1 adds counters and diagnostics.c, for tests and service */
#endif

#ifndef BOARD_HEARS_ITSELF
#define BOARD_HEARS_ITSELF 0 /* 1: the node receives its own bytes, as with /RE tied low; they are dropped */
#endif

#endif
