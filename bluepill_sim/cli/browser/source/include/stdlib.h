/* What the emulator uses of the standard library, where there is no system: `libc.c`. */
#ifndef BROWSER_STDLIB_H
#define BROWSER_STDLIB_H

#include <stddef.h>

void *malloc(size_t bytes);
void *calloc(size_t count, size_t bytes);
void *realloc(void *at, size_t bytes);
void free(void *at);

#endif
