// Loaded before the C library: the n-th request for memory from now on, whoever makes it, is refused.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>

static atomic_long left;

/// The request to be refused, counted from here, or 0 for none. Returns how many were left to go until then.
long refuse_allocation(long number) { return atomic_exchange(&left, number); }

static int refused(void) { return atomic_load(&left) > 0 && atomic_fetch_sub(&left, 1) == 1; }

void* malloc(size_t size) {
  static void* (*given)(size_t);
  if (!given) given = dlsym(RTLD_NEXT, "malloc");
  return refused() ? (errno = ENOMEM, NULL) : given(size);
}

void* realloc(void* memory, size_t size) {
  static void* (*given)(void*, size_t);
  if (!given) given = dlsym(RTLD_NEXT, "realloc");
  return refused() ? (errno = ENOMEM, NULL) : given(memory, size);
}
