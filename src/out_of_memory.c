/* A failed allocation ends the program with a message and its own exit code.
 *
 * gfortran's ALLOCATE would end it with exit code 1, which means 'not converged' here, and temporary arrays of the
 * compiler are not checked at all. The linker redirects the calls of the program's own code to these functions
 * (-Wl,--wrap); libraries keep theirs. */
#include <stddef.h>

_Noreturn void dotyk_out_of_memory(size_t bytes);
void *__real_malloc(size_t bytes);
void *__real_calloc(size_t n, size_t bytes);
void *__real_realloc(void *old, size_t bytes);

void *__wrap_malloc(size_t bytes) {
  void *memory = __real_malloc(bytes);
  if (!memory && bytes > 0) dotyk_out_of_memory(bytes);
  return memory;
}

void *__wrap_calloc(size_t n, size_t bytes) {
  void *memory = __real_calloc(n, bytes);
  if (!memory && n > 0 && bytes > 0) dotyk_out_of_memory(n * bytes);
  return memory;
}

void *__wrap_realloc(void *old, size_t bytes) {
  void *memory = __real_realloc(old, bytes);
  if (!memory && bytes > 0) dotyk_out_of_memory(bytes);
  return memory;
}
