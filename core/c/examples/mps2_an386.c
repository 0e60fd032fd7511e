// The machine of the example: QEMU's mps2-an386, a Cortex-M4F. Text and the end of the run go over
// semihosting.
#include "print_line.h"

#include <stdint.h>

int main(void);
void reset(void);

extern uint32_t stack_top, data_start, data_end, data_source, bss_start, bss_end;

static uint32_t semihosting(uint32_t operation, uintptr_t argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register uintptr_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

enum { SYS_WRITE0 = 0x04, SYS_EXIT = 0x18 };
enum { APPLICATION_EXIT = 0x20026, RUN_TIME_ERROR = 0x20023 };

void print_line(const char *text) {
    semihosting(SYS_WRITE0, (uintptr_t)text);
    semihosting(SYS_WRITE0, (uintptr_t) "\n");
}

static void leave(int outcome) {
    semihosting(SYS_EXIT, outcome == 0 ? APPLICATION_EXIT : RUN_TIME_ERROR);
    for (;;) {
    }
}

static void fault(void) {
    print_line("fault of the processor");
    leave(1);
}

void reset(void) {
    // Full access to the FPU (CPACR, coprocessors 10 and 11), before any function that may use it.
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
    const uint32_t *source = &data_source;
    for (uint32_t *word = &data_start; word < &data_end; ++word) {
        *word = *source++;
    }
    for (uint32_t *word = &bss_start; word < &bss_end; ++word) {
        *word = 0;
    }
    leave(main());
}

// What the processor finds at address 0: the first seven words; no interrupt is used.
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*handlers[6])(void);
} vectors = {&stack_top, {reset, fault, fault, fault, fault, fault}};
