/* CHOLMOD behind an opaque handle: one cholmod_common and one supernodal factor each, 64-bit indices.
 *
 * The struct layouts of cholmod.h are known here and nowhere else. Functions that may fail return one of the codes
 * below. analyze, permute and factorize change a handle, one thread at a time. Solves only read it: several threads may
 * solve with one factor at the same time. CHOLMOD reports memory that it cannot get; malloc and calloc of this file end
 * the program with a message (src/out_of_memory.c). */
#include <stdint.h>
#include <stdlib.h>

#include <cholmod.h>
#include <omp.h>

enum { OK = 0, OUT_OF_MEMORY = 1, NOT_POSITIVE = 2, TOO_LARGE = 3, INVALID = 4 };

typedef struct {
  cholmod_common common;
  cholmod_factor *L;
  cholmod_sparse *permuted; /* lower triangle of P K P^T, from permute to factorize */
  int64_t n;
} handle_t;

/* Mirrored as statistics_t in dotyk_linalg_cholesky. */
typedef struct {
  int64_t entries;         /* stored entries of the factor, zeros inside supernodes included */
  int64_t factor_bytes;    /* memory of the factor [bytes] */
  int64_t workspace_bytes; /* memory of a factorization beside the factor and the matrix, an estimate [bytes] */
  double flops;            /* floating-point operations of a factorization */
} statistics_t;

_Static_assert(sizeof(SuiteSparse_long) == sizeof(int64_t), "CHOLMOD's long integers must have 64 bits");

static int code_of_status(const cholmod_common *common) {
  switch (common->status) {
  case CHOLMOD_OK:
  case CHOLMOD_DSMALL: return OK;
  case CHOLMOD_OUT_OF_MEMORY: return OUT_OF_MEMORY;
  case CHOLMOD_NOT_POSDEF: return NOT_POSITIVE;
  case CHOLMOD_TOO_LARGE: return TOO_LARGE;
  default: return INVALID;
  }
}

/* Debian's CHOLMOD has parallel loops with num_threads(4) fixed at compile time. Outside a parallel region they start
 * threads that compete for the cores. The limit belongs to the calling task alone. */
static int forbid_threads(void) {
  int levels = omp_get_max_active_levels();
  omp_set_max_active_levels(0);
  return levels;
}

void dotyk_cholmod_free(void *handle) {
  handle_t *h = handle;
  if (!h) return;
  cholmod_l_free_sparse(&h->permuted, &h->common);
  cholmod_l_free_factor(&h->L, &h->common);
  cholmod_l_finish(&h->common);
  free(h);
}

void *dotyk_cholmod_new(void) {
  handle_t *h = calloc(1, sizeof *h);
  cholmod_common *c = &h->common;
  cholmod_l_start(c);
  c->print = 0;
  c->error_handler = NULL;
  c->useGPU = 0;
  c->supernodal = CHOLMOD_SUPERNODAL;
  c->final_ll = 1;
  c->quick_return_if_not_posdef = 1;
  c->nmethods = 1;
  c->method[0].ordering = CHOLMOD_GIVEN;
  c->postorder = 1;
  return h;
}

/* Symbolic analysis. start (n+1), row: pattern of the lower triangle by columns, rows ascending, 0-based;
 * permutation (n): the equation that comes k-th, 0-based; its last `trailing` ones stay last. The arrays are read where
 * they are. */
int dotyk_cholmod_analyze(void *handle, int64_t n, int64_t *start, int64_t *row, int64_t *permutation,
                          int64_t trailing, statistics_t *statistics) {
  handle_t *h = handle;
  cholmod_common *c = &h->common;
  cholmod_l_free_factor(&h->L, c);
  h->n = n;
  /* View of the pattern. */
  cholmod_sparse a = {.nrow = (size_t)n, .ncol = (size_t)n, .nzmax = (size_t)start[n], .p = start, .i = row,
                      .stype = -1, .itype = CHOLMOD_LONG, .xtype = CHOLMOD_PATTERN, .dtype = CHOLMOD_DOUBLE,
                      .sorted = 1, .packed = 1};
  int levels = forbid_threads();
  c->postorder = 1;
  h->L = cholmod_l_analyze_p(&a, (SuiteSparse_long *)permutation, NULL, 0, c);
  if (h->L && trailing > 0) {
    /* A postorder may take equations of the front behind trailing ones. Moved before them again, in the same order,
     * they are eliminated as before: the trailing ones are ancestors of what they touch in the elimination tree. */
    int64_t *order = malloc((size_t)n * sizeof *order);
    char *last = calloc((size_t)n, 1);
    if (order && last) {
      const SuiteSparse_long *found = h->L->Perm;
      for (int64_t k = n - trailing; k < n; k++) last[permutation[k]] = 1;
      int64_t front = 0;
      for (int64_t k = 0; k < n; k++) {
        if (!last[found[k]]) order[front++] = found[k];
      }
      for (int64_t k = n - trailing; k < n; k++) order[k] = permutation[k];
      cholmod_l_free_factor(&h->L, c);
      c->postorder = 0;
      h->L = cholmod_l_analyze_p(&a, (SuiteSparse_long *)order, NULL, 0, c);
    } else {
      c->status = CHOLMOD_OUT_OF_MEMORY;
      cholmod_l_free_factor(&h->L, c);
    }
    free(order);
    free(last);
  }
  omp_set_max_active_levels(levels);
  if (!h->L) return c->status == CHOLMOD_OK ? INVALID : code_of_status(c);
  if (!h->L->is_super) return INVALID;
  cholmod_l_free_work(c);
  const cholmod_factor *L = h->L;
  statistics->entries = (int64_t)L->xsize;
  statistics->factor_bytes = 8 * (int64_t)(L->xsize + L->ssize + 3 * (L->nsuper + 1) + 2 * L->n);
  statistics->workspace_bytes = 8 * ((int64_t)L->maxcsize + 2 * start[n] + 6 * n);
  statistics->flops = c->fl;
  return OK;
}

/* Make the lower triangle of P K P^T, so that the caller may free K before the factor is allocated: cholmod_factorize
 * makes two such copies at a time, and reads K to the end. */
int dotyk_cholmod_permute(void *handle, const int64_t *start, const int64_t *row, const double *value) {
  handle_t *h = handle;
  cholmod_common *c = &h->common;
  int64_t n = h->n;
  const SuiteSparse_long *permutation = h->L->Perm;
  cholmod_l_free_sparse(&h->permuted, c);
  cholmod_sparse *s = cholmod_l_allocate_sparse((size_t)n, (size_t)n, (size_t)start[n], 0, 1, -1, CHOLMOD_REAL, c);
  if (!s) return OUT_OF_MEMORY;
  int64_t *position = malloc((size_t)(n + 1) * sizeof *position);
  for (int64_t k = 0; k < n; k++) position[permutation[k]] = k;
  int64_t *first = s->p, *s_row = s->i;
  double *s_value = s->x;
  for (int64_t k = 0; k <= n; k++) first[k] = 0;
  for (int64_t j = 0; j < n; j++) {
    for (int64_t p = start[j]; p < start[j + 1]; p++) {
      int64_t a = position[row[p]], b = position[j];
      first[a < b ? a : b]++;
    }
  }
  /* Columns are filled from their ends: afterwards first[k] is the position of the first entry of column k. */
  for (int64_t k = 0, sum = 0; k <= n; k++) first[k] = sum += (k < n ? first[k] : 0);
  for (int64_t j = n - 1; j >= 0; j--) {
    for (int64_t p = start[j + 1] - 1; p >= start[j]; p--) {
      int64_t a = position[row[p]], b = position[j];
      int64_t q = --first[a < b ? a : b];
      s_row[q] = a < b ? b : a;
      s_value[q] = value[p];
    }
  }
  free(position);
  h->permuted = s;
  return OK;
}

/* Numeric factorization of the matrix that permute has made, which is freed: the numeric phase of cholmod_factorize.
 * failed: first column of L (from 1) whose pivot is not positive, 0 if there is none. */
int dotyk_cholmod_factorize(void *handle, int64_t *failed) {
  handle_t *h = handle;
  cholmod_common *c = &h->common;
  double shift[2] = {0, 0};
  int levels = forbid_threads();
  int good = cholmod_l_super_numeric(h->permuted, NULL, shift, h->L, c);
  omp_set_max_active_levels(levels);
  int code = code_of_status(c);
  cholmod_l_free_work(c);
  cholmod_l_free_sparse(&h->permuted, c);
  *failed = code == NOT_POSITIVE ? (int64_t)h->L->minor + 1 : 0;
  if (code == NOT_POSITIVE) return OK;
  return code == OK && !good ? INVALID : code;
}

/* The equations of the last m columns of L (1-based). */
void dotyk_cholmod_trailing(const void *handle, int64_t m, int64_t *equation) {
  const handle_t *h = handle;
  const SuiteSparse_long *permutation = h->L->Perm;
  for (int64_t k = 0; k < m; k++) equation[k] = permutation[h->n - m + k] + 1;
}

/* The arrays of the supernodes, valid until the next analysis. counts (2): number of supernodes, length of the list of
 * rows. pointers (6), all 0-based: first column of each supernode, position of its first row, position of its first
 * value, list of rows, permutation, values (null before the factorization). */
void dotyk_cholmod_supernodes(const void *handle, int64_t *counts, void **pointers) {
  const handle_t *h = handle;
  const cholmod_factor *L = h->L;
  counts[0] = (int64_t)L->nsuper;
  counts[1] = (int64_t)L->ssize;
  pointers[0] = L->super;
  pointers[1] = L->pi;
  pointers[2] = L->px;
  pointers[3] = L->s;
  pointers[4] = L->Perm;
  pointers[5] = L->x;
}

/* Solve K X = B by forward and back substitution, or by one of both alone, P^T L P X = B or P^T L^T P X = B; in place
 * on x (n,m). */
int dotyk_cholmod_solve(const void *handle, int64_t n, int64_t m, int forward, int back, double *x) {
  const handle_t *h = handle;
  cholmod_factor *L = h->L; /* the solves read it only */
  const SuiteSparse_long *permutation = L->Perm;
  cholmod_common common = h->common; /* takes the status of this solve */
  common.status = CHOLMOD_OK;
  size_t more = L->maxesize > 0 ? L->maxesize : 1;
  double *work = malloc(sizeof(double) * (size_t)m * ((size_t)n + more));
  cholmod_dense y = {.nrow = (size_t)n, .ncol = (size_t)m, .nzmax = (size_t)(n * m), .d = (size_t)n, .x = work,
                     .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
  cholmod_dense e = {.nrow = (size_t)m, .ncol = more, .nzmax = (size_t)m * more, .d = (size_t)m,
                     .x = work + (size_t)(n * m), .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
  for (int64_t j = 0; j < m; j++) {
    for (int64_t k = 0; k < n; k++) work[k + j * n] = x[permutation[k] + j * n];
  }
  int levels = forbid_threads();
  int good = !forward || cholmod_l_super_lsolve(L, &y, &e, &common);
  good = good && (!back || cholmod_l_super_ltsolve(L, &y, &e, &common));
  omp_set_max_active_levels(levels);
  for (int64_t j = 0; j < m; j++) {
    for (int64_t k = 0; k < n; k++) x[permutation[k] + j * n] = work[k + j * n];
  }
  free(work);
  return good ? OK : INVALID;
}
