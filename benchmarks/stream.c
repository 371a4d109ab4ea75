/* STREAM triad a = b + s c (J. D. McCalpin) on arrays beyond the caches: prints GB/s, the best of eight.
   gcc -O3 -march=native -fopenmp stream.c; threads: OMP_NUM_THREADS. */
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>

int main(void) {
  const long n = 20000000;
  double *a = malloc(n*sizeof *a), *b = malloc(n*sizeof *b), *c = malloc(n*sizeof *c), best = 1e30;
  if (!a || !b || !c) return 1;
#pragma omp parallel for schedule(static)
  for (long i = 0; i < n; i++) {
    a[i] = 0;
    b[i] = 1;
    c[i] = 2;
  }
  for (int k = 0; k < 8; k++) {
    double start = omp_get_wtime();
#pragma omp parallel for schedule(static)
    for (long i = 0; i < n; i++) a[i] = b[i] + 3*c[i];
    double seconds = omp_get_wtime() - start;
    if (seconds < best) best = seconds;
  }
  printf("%.2f\n", a[n - 1] > 0 ? 24e-9*n/best : 0.0);
  return 0;
}
