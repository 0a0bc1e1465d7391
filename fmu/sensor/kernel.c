/* Which kernel a network runs on. */
#include "kernel.h"

#ifdef KERNELS_WIDE
#include <cpuid.h>

/* Whether the operating system saves the registers of which the bits tell (Intel's manual, XCR0). */
static bool saved(unsigned bits) {
    unsigned low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    (void)high;
    return (low & bits) == bits;
}

static bool has(bool wide) {
    unsigned a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_FMA) || !saved(0x6)) return false;
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2)) return false;
    return !wide || ((b & bit_AVX512F) && saved(0xE6));
}
#else
static bool has(bool wide) {
    (void)wide;
    return false;
}
#endif

/* Best first. */
static const Kernel *const KERNELS[] = {
#ifdef KERNELS_WIDE
    &KERNEL_AVX512, &KERNEL_AVX2,
#endif
#ifdef KERNELS_SSE2
    &KERNEL_SSE2,
#endif
#ifdef KERNELS_NEON
    &KERNEL_NEON,
#endif
    &KERNEL_PORTABLE,
};
enum { COUNT = sizeof KERNELS / sizeof *KERNELS };

static bool runs(const Kernel *kernel) {
#ifdef KERNELS_WIDE
    if (kernel == &KERNEL_AVX512) return has(true);
    if (kernel == &KERNEL_AVX2) return has(false);
#endif
    (void)has, (void)kernel;
    return true;
}

static const Kernel *chosen; /* NULL: the best */

const Kernel *best_kernel(void) {
    int k = 0;
    while (!chosen && !runs(KERNELS[k])) ++k; /* the last one runs everywhere */
    return chosen ? chosen : KERNELS[k];
}

const char *network_kernel(void) { return best_kernel()->name; }

static bool same(const char *a, const char *b) {
    while (*a && *a == *b) ++a, ++b;
    return *a == *b;
}

bool network_choose_kernel(const char *name) {
    for (int k = 0; k < COUNT; ++k) {
        if (!same(KERNELS[k]->name, name)) continue;
        if (!runs(KERNELS[k])) return false;
        chosen = KERNELS[k];
        return true;
    }
    return false;
}
