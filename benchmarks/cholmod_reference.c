/* What plain CHOLMOD with METIS needs for the stiffness matrices of a scene: cholmod_reference M FILE...
 *
 * stiffness_matrices.py makes the files. One line for each: unknowns, entries of the lower triangle, entries and bytes of the
 * factor, flops, seconds of ordering with symbolic analysis, of the factorization, of one solve; processor seconds of the first
 * two; residual of the solve. Before them a line with the rate of DGEMM of the same BLAS [flop/s], and the seconds of a solve
 * with a dense triangular factor of M unknowns. All is CHOLMOD's default, but that METIS is the only ordering and the factor
 * supernodal. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cholmod.h>
#include <omp.h>

void dgemm_(const char *, const char *, const int *, const int *, const int *, const double *, const double *, const int *,
            const double *, const int *, const double *, double *, const int *);

void dtrsv_(const char *, const char *, const char *, const int *, const double *, const int *, double *, const int *);

static double seconds(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double dgemm_rate(int n) {
  size_t size = (size_t)n * (size_t)n;
  double *a = malloc(3 * size * sizeof *a), one = 1, zero = 0, best = 0;
  if (!a) return 0;
  for (size_t i = 0; i < 3 * size; i++) a[i] = (double)(i % 7) / 7;
  for (int k = 0; k < 3; k++) {
    double start = seconds(CLOCK_MONOTONIC);
    dgemm_("N", "N", &n, &n, &n, &one, a, &n, a + size, &n, &zero, a + 2 * size, &n);
    double rate = 2.0 * n * n * n / (seconds(CLOCK_MONOTONIC) - start);
    if (rate > best) best = rate;
  }
  free(a);
  return best;
}

/* Forwards and backwards with one right-hand side, in the mean of some. */
static double triangular_seconds(int m) {
  double *l = malloc(((size_t)m + 1) * (size_t)m * sizeof *l);
  if (!l || m < 1) return 0;
  for (size_t i = 0; i < ((size_t)m + 1) * (size_t)m; i++) l[i] = i % ((size_t)m + 1) ? 1e-3 : 1;
  int one = 1, times = 10;
  double start = seconds(CLOCK_MONOTONIC);
  for (int k = 0; k < times; k++) {
    double *x = l + (size_t)m * (size_t)m;
    for (int i = 0; i < m; i++) x[i] = 1;
    dtrsv_("L", "N", "N", &m, l, &m, x, &one);
    dtrsv_("L", "T", "N", &m, l, &m, x, &one);
  }
  free(l);
  return (seconds(CLOCK_MONOTONIC) - start) / times;
}

/* The file: n, entries, start (n+1), row (entries), all int64, then value (entries): lower triangle by columns, rows ascending,
 * 0-based. */
static cholmod_sparse *read_matrix(const char *path, cholmod_common *c) {
  FILE *file = fopen(path, "rb");
  int64_t size[2];
  if (!file || fread(size, sizeof *size, 2, file) != 2) return NULL;
  cholmod_sparse *a = cholmod_l_allocate_sparse((size_t)size[0], (size_t)size[0], (size_t)size[1], 1, 1, -1, CHOLMOD_REAL, c);
  if (!a) return NULL;
  size_t entries = (size_t)size[1];
  int good = fread(a->p, 8, (size_t)size[0] + 1, file) == (size_t)size[0] + 1 && fread(a->i, 8, entries, file) == entries &&
             fread(a->x, 8, entries, file) == entries;
  fclose(file);
  return good ? a : NULL;
}

static int measure(const char *path) {
  cholmod_common c;
  cholmod_l_start(&c);
  c.supernodal = CHOLMOD_SUPERNODAL;
  c.nmethods = 1;
  c.method[0].ordering = CHOLMOD_METIS;
  c.postorder = 1;
  c.useGPU = 0;
  cholmod_sparse *a = read_matrix(path, &c);
  if (!a) return fprintf(stderr, "cholmod_reference: cannot read '%s'\n", path), 1;
  double start = seconds(CLOCK_MONOTONIC), processor = seconds(CLOCK_PROCESS_CPUTIME_ID);
  cholmod_factor *l = cholmod_l_analyze(a, &c);
  double order = seconds(CLOCK_MONOTONIC) - start;
  if (!l || c.method[0].ordering != CHOLMOD_METIS) return fprintf(stderr, "cholmod_reference: no ordering by METIS\n"), 1;
  start = seconds(CLOCK_MONOTONIC);
  cholmod_l_factorize(a, l, &c);
  double factorize = seconds(CLOCK_MONOTONIC) - start;
  processor = seconds(CLOCK_PROCESS_CPUTIME_ID) - processor;
  if (c.status != CHOLMOD_OK || l->minor < l->n) return fprintf(stderr, "cholmod_reference: '%s' is not positive\n", path), 1;
  cholmod_dense *b = cholmod_l_ones(a->nrow, 1, CHOLMOD_REAL, &c);
  start = seconds(CLOCK_MONOTONIC);
  cholmod_dense *x = cholmod_l_solve(CHOLMOD_A, l, b, &c);
  double solve = seconds(CLOCK_MONOTONIC) - start;
  double one[2] = {1, 0}, minus[2] = {-1, 0};
  cholmod_l_sdmult(a, 0, minus, one, x, b, &c);
  long entries = (long)((SuiteSparse_long *)a->p)[a->ncol];
  long bytes = (long)(8 * (l->xsize + l->ssize + 3 * (l->nsuper + 1) + 2 * l->n));
  printf("%s %ld %ld %ld %ld %.6e %.6f %.6f %.6f %.6f %.2e\n", path, (long)a->nrow, entries, (long)l->xsize, bytes, c.fl, order,
         factorize, solve, processor, cholmod_l_norm_dense(b, 0, &c));
  cholmod_l_free_dense(&x, &c);
  cholmod_l_free_dense(&b, &c);
  cholmod_l_free_factor(&l, &c);
  cholmod_l_free_sparse(&a, &c);
  cholmod_l_finish(&c);
  return 0;
}

int main(int count, char **argument) {
  /* CHOLMOD's own loops start four threads each, whatever is asked for: with them it is slower, on a busy machine many times. */
  omp_set_max_active_levels(0);
  if (count < 2) return fprintf(stderr, "usage: cholmod_reference M FILE...\n"), 1;
  printf("dgemm %.6e %.6e\n", dgemm_rate(1500), triangular_seconds(atoi(argument[1])));
  for (int k = 2; k < count; k++) {
    if (measure(argument[k])) return 1;
  }
  return 0;
}
