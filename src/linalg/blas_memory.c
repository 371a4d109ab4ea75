/* Buffers of OpenBLAS.
 *
 * Each of several concurrent calls takes a buffer of its own (128 MiB of addresses, of which it touches little), and
 * keeps it for later calls. Without memory for a buffer, as under `ulimit -v`, OpenBLAS retries for ever. Therefore all
 * buffers are taken at the start, after a test for room: malloc ends the program with a message if there is none
 * (src/out_of_memory.c). */
#include <stdlib.h>

extern void *blas_memory_alloc(int) __attribute__((weak));
extern void blas_memory_free(void *) __attribute__((weak));

enum { most = 64 };                                  /* OpenBLAS keeps at most as many buffers, as Debian builds it */
static const size_t buffer_size = (size_t)128 << 20; /* of Debian's OpenBLAS on x86-64 */
static const size_t more = 1 << 20;                  /* for what malloc needs beside it */

/* Take the buffers of n concurrent calls. */
void dotyk_reserve_blas(int n) {
  void *buffer[most];
  int taken = 0;
  if (!blas_memory_alloc || !blas_memory_free) return;
  if (n > most) n = most;
  while (taken < n) {
    void *volatile room = malloc(buffer_size + more); /* volatile: or the compiler leaves the pair of calls out */
    free(room);
    buffer[taken++] = blas_memory_alloc(0);
  }
  for (int k = taken; k > 0; k--) blas_memory_free(buffer[k - 1]);
}
