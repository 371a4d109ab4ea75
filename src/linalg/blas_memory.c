/* Room that OpenBLAS works in.
 *
 * Each call that runs at the same time as others takes a buffer of its own (128 MiB of addresses, of which it touches little), and keeps it
 * for later calls. Where there is no memory for one, as under `ulimit -v`, it tries again for ever. So all are taken at the beginning, after a
 * look whether there is room: malloc ends the program with a message where there is none (src/out_of_memory.c). */
#include <stdlib.h>

extern void *blas_memory_alloc(int) __attribute__((weak));
extern void blas_memory_free(void *) __attribute__((weak));

enum { most = 64 };
static const size_t buffer_size = (size_t)128 << 20, more = 1 << 20;

/* Take buffers for n calls at the same time. */
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
