/* The sensor on a bare Cortex-M7: fixed memory, no operating system, no heap. Takes the samples that were linked in, one after the
 * other, and tells the debugger (semihosting) the estimates, the time that each took, and how deep the stack was.
 *
 * The board is Arm's MPS2+ with image AN500, which QEMU has as mps2-an500. */
#include <stdint.h>
#include <string.h>

#include "network.h"
#include "sizes.h" /* STATE_FLOATS and SCRATCH_FLOATS of the network */

extern uint32_t stack_top[], stack_end[], data_begin[], data_end[], data_source[], bss_begin[], bss_end[];
extern const unsigned char network_begin[], network_end[];
extern const double samples_begin[][CHANNELS + COMMANDS], samples_end[][CHANNELS + COMMANDS];

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define TIMER_CONTROL REGISTER(0xE000E010u)
#define TIMER_RELOAD REGISTER(0xE000E014u)
#define TIMER REGISTER(0xE000E018u) /* counts down at the processor's clock */
#define COPROCESSORS REGISTER(0xE000ED88u)

enum { TIMER_BITS = 0xFFFFFF, WRITE_TEXT = 0x04, END = 0x18, STOPPED_WELL = 0x20026, STOPPED_BADLY = 0x20024, UNTOUCHED = 0x5A5A5A5A };

static Network network;
static _Alignas(64) float state[STATE_FLOATS], scratch[SCRATCH_FLOATS];

int *__errno(void); /* newlib's mathematics put their faults here */
int *__errno(void) {
    static int number;
    return &number;
}

static void debugger(uint32_t operation, uint32_t argument) {
    register uint32_t r0 __asm__("r0") = operation, r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

static void say(const char *text) { debugger(WRITE_TEXT, (uint32_t)text); }

static void stop(const char *text) {
    say(text);
    say("\n");
    debugger(END, STOPPED_BADLY);
}

static void say_word(uint32_t word) {
    char text[10];
    for (int i = 0; i < 8; ++i) text[i] = "0123456789abcdef"[word >> (28 - 4 * i) & 15];
    text[8] = ' ', text[9] = 0;
    say(text);
}

static void say_float(double value) {
    const float single = (float)value; /* as which it was computed */
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    say_word(bits);
}

static void take(const double sample[CHANNELS + COMMANDS]) {
    double estimate[WHEELS] = {0}, deviation[WHEELS] = {0};
    const uint32_t before = TIMER;
    const bool counts = network_step(&network, state, scratch, sample, sample + CHANNELS, estimate, deviation, NULL);
    const uint32_t ticks = (before - TIMER) & TIMER_BITS;
    say("sample ");
    say_word(ticks);
    say_word(counts);
    for (int i = 0; i < WHEELS; ++i) say_float(estimate[i]);
    for (int i = 0; i < WHEELS; ++i) say_float(deviation[i]);
    say("\n");
}

static uint32_t stack_used(void) {
    const uint32_t *at = stack_end;
    while (*at == UNTOUCHED) ++at;
    return (uint32_t)(stack_top - at) * (uint32_t)sizeof *at;
}

int main(void) {
    const char *wrong = network_open(&network, network_begin, (size_t)(network_end - network_begin));
    if (wrong) stop(wrong);
    if (network_state_bytes(&network) > sizeof state || network_scratch_bytes(&network) > sizeof scratch) stop("The fixed memory is too small.");
    network_reset(&network, state);
    TIMER_RELOAD = TIMER_BITS;
    TIMER = 0;
    TIMER_CONTROL = 5;
    for (const double(*sample)[CHANNELS + COMMANDS] = samples_begin; sample < samples_end; ++sample) take(*sample);
    say("stack ");
    say_word(stack_used());
    say("\n");
    debugger(END, STOPPED_WELL);
    return 0;
}

static void reset(void) {
    COPROCESSORS |= 0xFu << 20; /* the floating-point unit */
    __asm__ volatile("dsb\n isb");
    memcpy(data_begin, data_source, (size_t)((char *)data_end - (char *)data_begin));
    memset(bss_begin, 0, (size_t)((char *)bss_end - (char *)bss_begin));
    const uint32_t *here = __builtin_frame_address(0);
    for (uint32_t *at = stack_end; at < here - 32; ++at) *at = UNTOUCHED;
    main();
}

static void fault(void) { stop("The processor met a fault."); }

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[] = {
    (uintptr_t)stack_top, (uintptr_t)reset, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault,
};
