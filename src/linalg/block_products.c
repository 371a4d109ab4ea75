/* Products of sparse matrices of 3x3 blocks for some rows: loops of dotyk_linalg_block_products that Fortran compilers
 * leave scalar. A column of a block is multiplied four entries at a time; the fourth is the next one in memory, and its
 * sum is not used. Without fused multiplication and addition, so that the digits are those of any processor. */
#include <stdint.h>
#include <string.h>

typedef float four_t __attribute__((vector_size(16)));
typedef double four_double_t __attribute__((vector_size(32)));

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FASTEST __attribute__((target_clones("avx2", "default")))
#else
#define FASTEST
#endif

#define LOAD(v, p) four_t v; memcpy(&v, p, sizeof v)
#define LOAD_DOUBLE(v, p) four_double_t v; do { LOAD(v##_, p); v = __builtin_convertvector(v##_, four_double_t); } while (0)

/* y = (high + low) x for the rows first to last, from 1. */
FASTEST
void dotyk_product_rows(int32_t first, int32_t last, const int64_t *start, const int32_t *column, const float *high,
                        const float *low, const double *x, double *y)
{
  for (int64_t i = first - 1; i < last; i++) {
    four_double_t sum = {0, 0, 0, 0};
    for (int64_t k = start[i] - 1; k < start[i + 1] - 1; k++) {
      const float *h = high + 9*k, *l = low + 9*k;
      const double *p = x + 3*((int64_t)column[k] - 1);
      LOAD_DOUBLE(h1, h);
      LOAD_DOUBLE(h2, h + 3);
      LOAD_DOUBLE(h3, h + 6);
      LOAD_DOUBLE(l1, l);
      LOAD_DOUBLE(l2, l + 3);
      LOAD_DOUBLE(l3, l + 6);
      sum += ((h1 + l1)*p[0] + (h2 + l2)*p[1]) + (h3 + l3)*p[2];
    }
    for (int j = 0; j < 3; j++) y[3*i + j] = sum[j];
  }
}

/* r = b - high x for the rows first to last, from 1. */
FASTEST
void dotyk_residual_rows(int32_t first, int32_t last, const int64_t *start, const int32_t *column, const float *high,
                         const float *b, const float *x, float *r)
{
  for (int64_t i = first - 1; i < last; i++) {
    four_t sum = {0, 0, 0, 0};
    for (int64_t k = start[i] - 1; k < start[i + 1] - 1; k++) {
      const float *h = high + 9*k, *p = x + 3*((int64_t)column[k] - 1);
      LOAD(h1, h);
      LOAD(h2, h + 3);
      LOAD(h3, h + 6);
      sum += (h1*p[0] + h2*p[1]) + h3*p[2];
    }
    for (int j = 0; j < 3; j++) r[3*i + j] = b[3*i + j] - sum[j];
  }
}

/* r := r - high x, x in double precision, for the rows first to last, from 1. */
FASTEST
void dotyk_subtract_product_rows(int32_t first, int32_t last, const int64_t *start, const int32_t *column,
                                 const float *high, const double *x, float *r)
{
  for (int64_t i = first - 1; i < last; i++) {
    four_double_t sum = {0, 0, 0, 0};
    for (int64_t k = start[i] - 1; k < start[i + 1] - 1; k++) {
      const float *h = high + 9*k;
      const double *p = x + 3*((int64_t)column[k] - 1);
      LOAD_DOUBLE(h1, h);
      LOAD_DOUBLE(h2, h + 3);
      LOAD_DOUBLE(h3, h + 6);
      sum += (h1*p[0] + h2*p[1]) + h3*p[2];
    }
    for (int j = 0; j < 3; j++) r[3*i + j] = (float)(r[3*i + j] - sum[j]);
  }
}
