/* Which kernel a network runs on. */
#include "kernel.h"

extern const Kernel PORTABLE;

static const Kernel *const KERNELS[] = {&PORTABLE}; /* best first */
enum { COUNT = sizeof KERNELS / sizeof *KERNELS };

static const Kernel *chosen; /* NULL: the best */

static bool same(const char *a, const char *b) {
    while (*a && *a == *b) ++a, ++b;
    return *a == *b;
}

const Kernel *best_kernel(void) { return chosen ? chosen : KERNELS[0]; }

const char *network_kernel(void) { return best_kernel()->name; }

bool network_choose_kernel(const char *name) {
    for (int i = 0; i < COUNT; ++i) {
        if (!same(KERNELS[i]->name, name)) continue;
        chosen = KERNELS[i];
        return true;
    }
    return false;
}
