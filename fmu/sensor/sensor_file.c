/* The network's file, as bytes in aligned memory. */
#include "sensor.h"

#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#endif

void *aligned_room(size_t size, void **memory)
{
    *memory = calloc(1, size + ALIGNMENT);
    return *memory ? (char *)*memory + ALIGNMENT - (uintptr_t)*memory % ALIGNMENT : NULL;
}

/* `path` is UTF-8, as FMI has it. */
static FILE *open_file(const char *path)
{
#ifdef _WIN32
    wchar_t wide[4096];
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096) ? _wfopen(wide, L"rb") : NULL;
#else
    return fopen(path, "rb");
#endif
}

void *read_blob(const char *path, size_t *size, void **memory, const char **why)
{
    FILE *file = open_file(path);
    void *blob = NULL;
    long length = -1;

    *memory = NULL;
    *why = "It cannot be opened.";
    if (!file)
        return NULL;
    if (fseek(file, 0, SEEK_END) == 0)
        length = ftell(file);
    *why = "It cannot be read.";
    if (length >= 0 && fseek(file, 0, SEEK_SET) == 0) {
        *why = "Memory is short.";
        blob = aligned_room((size_t)length, memory);
        if (blob && fread(blob, 1, (size_t)length, file) != (size_t)length) {
            *why = "It cannot be read.";
            blob = NULL;
        }
    }
    fclose(file);
    *size = blob ? (size_t)length : 0;
    if (!blob) {
        free(*memory);
        *memory = NULL;
    }
    return blob;
}
