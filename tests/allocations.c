/* Preloaded: counts what the sensor's binary takes from the heap, and nothing else of the process; from the first
 * question on, since looking for each caller takes its time. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stddef.h>
#include <string.h>

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *memory, size_t size);

static int asked;
static long count;

long allocations(void)
{
    asked = 1;
    return count;
}

static void note(const void *caller)
{
    Dl_info info;
    count += asked && dladdr(caller, &info) && info.dli_fname && strstr(info.dli_fname, "/sensor.so");
}

void *malloc(size_t size)
{
    note(__builtin_return_address(0));
    return __libc_malloc(size);
}

void *calloc(size_t n, size_t size)
{
    note(__builtin_return_address(0));
    return __libc_calloc(n, size);
}

void *realloc(void *memory, size_t size)
{
    note(__builtin_return_address(0));
    return __libc_realloc(memory, size);
}
