/* Products of sparse matrices of 2x2 or 3x3 blocks: the loops of dotyk_linalg_block_products.
 *
 * An entry of a matrix is high + low; high is a number in single precision whose upper and lower 16 bits are in two
 * arrays, so that smoothers read the upper ones alone. Each of the dim*dim entries of the blocks of a row has a sum of
 * its own, in the order of the blocks; in the end the sums of a row of a block are added. All versions of a loop do
 * these operations, without fused multiplication and addition (-ffp-contract=off): the digits are those of any
 * processor. Vectors are read from one entry before a node on, but for the first node: GCC 12 makes slow code of three
 * entries. Matrices have one block more than they need, which the loops may read. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define VECTORS 1
#include <immintrin.h>
#endif

#define INLINE static inline __attribute__((always_inline))

/* The matrix; rows and columns from 1. */
typedef struct {
  const int64_t *start;     /* first block of each row */
  const int32_t *column;    /* block column of each block */
  const uint16_t *leading;  /* upper halves of the entries of each block, column by column */
  const uint16_t *trailing; /* their lower halves */
  const float *low;         /* remainders */
} matrix_t;

/* Sums of the entries 0 to 8 of the blocks of a row. */
typedef struct {
  float entry[16];
} sums_t;

typedef struct {
  double entry[9];
} double_sums_t;

INLINE float joined(uint16_t leading, uint16_t trailing)
{
  uint32_t bits = (uint32_t)leading << 16 | trailing;
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

/* Sums of a row, x in single precision; the upper halves alone where whole is 0. */
INLINE sums_t sums_any(int dim, int whole, const matrix_t *a, int64_t i, const float *x)
{
  sums_t s;
  const int n = dim*dim;
  for (int e = 0; e < n; e++) s.entry[e] = 0;
  for (int64_t k = a->start[i] - 1; k < a->start[i + 1] - 1; k++) {
    const float *p = x + dim*((int64_t)a->column[k] - 1);
    for (int e = 0; e < n; e++)
      s.entry[e] += joined(a->leading[n*k + e], whole ? a->trailing[n*k + e] : 0)*p[e/dim];
  }
  return s;
}

/* Sums of a row, x in double precision; without remainders where exact is 0. */
INLINE double_sums_t double_sums_any(int dim, int exact, const matrix_t *a, int64_t i, const double *x)
{
  double_sums_t s;
  const int n = dim*dim;
  for (int e = 0; e < n; e++) s.entry[e] = 0;
  for (int64_t k = a->start[i] - 1; k < a->start[i + 1] - 1; k++) {
    const double *p = x + dim*((int64_t)a->column[k] - 1);
    for (int e = 0; e < n; e++) {
      double h = joined(a->leading[n*k + e], a->trailing[n*k + e]);
      if (exact) h += a->low[n*k + e];
      s.entry[e] += h*p[e/dim];
    }
  }
  return s;
}

#ifdef VECTORS
#define AVX2 __attribute__((target("avx2")))
#define AVX512 __attribute__((target("avx2,avx512f")))

AVX2 INLINE __m256 joined_8(const uint16_t *leading, const uint16_t *trailing)
{
  __m256i bits = _mm256_slli_epi32(_mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)leading)), 16);
  if (trailing)
    bits = _mm256_or_si256(bits, _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)trailing)));
  return _mm256_castsi256_ps(bits);
}

AVX2 INLINE sums_t sums_avx2(int dim, int whole, const matrix_t *a, int64_t i, const float *x)
{
  const __m256i spread = _mm256_setr_epi32(1, 1, 1, 2, 2, 2, 3, 3);
  __m256 sum = _mm256_setzero_ps();
  float last = 0;
  sums_t s;
  (void)dim;
  for (int64_t k = a->start[i] - 1; k < a->start[i + 1] - 1; k++) {
    int64_t j = (int64_t)a->column[k] - 1;
    const float *p = x + 3*j;
    __m128 v = j > 0 ? _mm_loadu_ps(p - 1) : _mm_setr_ps(0, p[0], p[1], p[2]);
    __m256 q = _mm256_permutevar8x32_ps(_mm256_castps128_ps256(v), spread);
    sum = _mm256_add_ps(sum, _mm256_mul_ps(joined_8(a->leading + 9*k, whole ? a->trailing + 9*k : NULL), q));
    last += joined(a->leading[9*k + 8], whole ? a->trailing[9*k + 8] : 0)*p[2];
  }
  _mm256_storeu_ps(s.entry, sum);
  s.entry[8] = last;
  return s;
}

AVX2 INLINE double_sums_t double_sums_avx2(int dim, int exact, const matrix_t *a, int64_t i, const double *x)
{
  __m256d sum = _mm256_setzero_pd(), next = _mm256_setzero_pd();
  double_sums_t s;
  double last = 0;
  (void)dim;
  for (int64_t k = a->start[i] - 1; k < a->start[i + 1] - 1; k++) {
    int64_t j = (int64_t)a->column[k] - 1;
    const double *p = x + 3*j;
    __m256d v = j > 0 ? _mm256_loadu_pd(p - 1) : _mm256_setr_pd(0, p[0], p[1], p[2]);
    __m256 h = joined_8(a->leading + 9*k, a->trailing + 9*k);
    __m256d h1 = _mm256_cvtps_pd(_mm256_castps256_ps128(h)), h2 = _mm256_cvtps_pd(_mm256_extractf128_ps(h, 1));
    double h3 = joined(a->leading[9*k + 8], a->trailing[9*k + 8]);
    if (exact) {
      h1 = _mm256_add_pd(h1, _mm256_cvtps_pd(_mm_loadu_ps(a->low + 9*k)));
      h2 = _mm256_add_pd(h2, _mm256_cvtps_pd(_mm_loadu_ps(a->low + 9*k + 4)));
      h3 += a->low[9*k + 8];
    }
    sum = _mm256_add_pd(sum, _mm256_mul_pd(h1, _mm256_permute4x64_pd(v, 0x95)));
    next = _mm256_add_pd(next, _mm256_mul_pd(h2, _mm256_permute4x64_pd(v, 0xfa)));
    last += h3*p[2];
  }
  _mm256_storeu_pd(s.entry, sum);
  _mm256_storeu_pd(s.entry + 4, next);
  s.entry[8] = last;
  return s;
}

AVX512 INLINE sums_t sums_avx512(int dim, int whole, const matrix_t *a, int64_t i, const float *x)
{
  const __m512i spread = _mm512_setr_epi32(1, 1, 1, 2, 2, 2, 3, 3, 3, 0, 0, 0, 0, 0, 0, 0);
  __m512 sum = _mm512_setzero_ps();
  sums_t s;
  (void)dim;
  for (int64_t k = a->start[i] - 1; k < a->start[i + 1] - 1; k++) {
    int64_t j = (int64_t)a->column[k] - 1;
    const float *p = x + 3*j;
    __m128 v = j > 0 ? _mm_loadu_ps(p - 1) : _mm_setr_ps(0, p[0], p[1], p[2]);
    __m512i h = _mm512_slli_epi32(
      _mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(a->leading + 9*k))), 16);
    if (whole)
      h = _mm512_or_si512(h, _mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(a->trailing + 9*k))));
    __m512 q = _mm512_permutexvar_ps(spread, _mm512_castps128_ps512(v));
    sum = _mm512_add_ps(sum, _mm512_mul_ps(_mm512_castsi512_ps(h), q));
  }
  _mm512_storeu_ps(s.entry, sum);
  return s;
}

AVX512 INLINE double_sums_t double_sums_avx512(int dim, int exact, const matrix_t *a, int64_t i, const double *x)
{
  const __m512i spread = _mm512_setr_epi64(1, 1, 1, 2, 2, 2, 3, 3);
  __m512d sum = _mm512_setzero_pd();
  double_sums_t s;
  double last = 0;
  (void)dim;
  for (int64_t k = a->start[i] - 1; k < a->start[i + 1] - 1; k++) {
    int64_t j = (int64_t)a->column[k] - 1;
    const double *p = x + 3*j;
    __m256d v = j > 0 ? _mm256_loadu_pd(p - 1) : _mm256_setr_pd(0, p[0], p[1], p[2]);
    __m512d h = _mm512_cvtps_pd(joined_8(a->leading + 9*k, a->trailing + 9*k));
    double h3 = joined(a->leading[9*k + 8], a->trailing[9*k + 8]);
    if (exact) {
      h = _mm512_add_pd(h, _mm512_cvtps_pd(_mm256_loadu_ps(a->low + 9*k)));
      h3 += a->low[9*k + 8];
    }
    sum = _mm512_add_pd(sum, _mm512_mul_pd(h, _mm512_permutexvar_pd(spread, _mm512_castpd256_pd512(v))));
    last += h3*p[2];
  }
  _mm512_storeu_pd(s.entry, sum);
  s.entry[8] = last;
  return s;
}
#endif

/* Entry i of the product of a row. */
#define ENTRY(s, dim, i) \
  ((dim) == 3 ? (s.entry[i] + s.entry[3 + (i)]) + s.entry[6 + (i)] : s.entry[i] + s.entry[2 + (i)])

/* The loops over rows, for one kind of processor and one order of the blocks. */
#define LOOPS(NAME, TARGET, SUMS, DOUBLE_SUMS, DIM) \
TARGET static void product_##NAME(int64_t first, int64_t last, const matrix_t *a, const double *x, double *y) \
{ \
  for (int64_t i = first; i < last; i++) { \
    double_sums_t s = DOUBLE_SUMS(DIM, 1, a, i, x); \
    for (int j = 0; j < DIM; j++) y[DIM*i + j] = ENTRY(s, DIM, j); \
  } \
} \
TARGET static void subtract_##NAME(int64_t first, int64_t last, const matrix_t *a, const double *x, float *r) \
{ \
  for (int64_t i = first; i < last; i++) { \
    double_sums_t s = DOUBLE_SUMS(DIM, 0, a, i, x); \
    for (int j = 0; j < DIM; j++) r[DIM*i + j] = (float)(r[DIM*i + j] - ENTRY(s, DIM, j)); \
  } \
} \
TARGET static void residual_##NAME(int64_t first, int64_t last, const matrix_t *a, int whole, const float *b, \
                                   const float *x, float *r) \
{ \
  if (whole) { \
    for (int64_t i = first; i < last; i++) { \
      sums_t s = SUMS(DIM, 1, a, i, x); \
      for (int j = 0; j < DIM; j++) r[DIM*i + j] = b[DIM*i + j] - ENTRY(s, DIM, j); \
    } \
  } else { \
    for (int64_t i = first; i < last; i++) { \
      sums_t s = SUMS(DIM, 0, a, i, x); \
      for (int j = 0; j < DIM; j++) r[DIM*i + j] = b[DIM*i + j] - ENTRY(s, DIM, j); \
    } \
  } \
} \
TARGET static void smooth_##NAME(int64_t first, int64_t last, const matrix_t *a, const float *inverse, float c, \
                                 float d, const float *b, const float *x, float *p, float *next) \
{ \
  for (int64_t i = first; i < last; i++) { \
    float r[DIM]; \
    sums_t s = SUMS(DIM, 0, a, i, x); \
    for (int j = 0; j < DIM; j++) r[j] = b[DIM*i + j] - ENTRY(s, DIM, j); \
    for (int j = 0; j < DIM; j++) { \
      float t = 0; \
      for (int m = 0; m < DIM; m++) t += inverse[DIM*DIM*i + DIM*m + j]*r[m]; \
      t = c*p[DIM*i + j] + d*t; \
      p[DIM*i + j] = t; \
      next[DIM*i + j] = x[DIM*i + j] + t; \
    } \
  } \
}

#define ANYWHERE
LOOPS(any_2, ANYWHERE, sums_any, double_sums_any, 2)
LOOPS(any_3, ANYWHERE, sums_any, double_sums_any, 3)
#ifdef VECTORS
LOOPS(avx2_3, AVX2, sums_avx2, double_sums_avx2, 3)
LOOPS(avx512_3, AVX512, sums_avx512, double_sums_avx512, 3)
#endif

/* The loops for one kind of processor. */
typedef struct {
  void (*product)(int64_t, int64_t, const matrix_t *, const double *, double *);
  void (*subtract)(int64_t, int64_t, const matrix_t *, const double *, float *);
  void (*residual)(int64_t, int64_t, const matrix_t *, int, const float *, const float *, float *);
  void (*smooth)(int64_t, int64_t, const matrix_t *, const float *, float, float, const float *, const float *, float *,
                 float *);
} loops_t;

#define TABLE(NAME) {product_##NAME, subtract_##NAME, residual_##NAME, smooth_##NAME}

/* Widest vectors to use: 0 none, 1 AVX2, 2 AVX-512; a limit for tests. */
static int widest = 2;

void dotyk_limit_vectors(int32_t limit)
{
  widest = limit;
}

static const loops_t *loops_for(int dim)
{
  static const loops_t any_2 = TABLE(any_2), any_3 = TABLE(any_3);
#ifdef VECTORS
  static const loops_t avx2_3 = TABLE(avx2_3), avx512_3 = TABLE(avx512_3);
  if (dim == 3 && widest > 1 && __builtin_cpu_supports("avx512f")) return &avx512_3;
  if (dim == 3 && widest > 0 && __builtin_cpu_supports("avx2")) return &avx2_3;
#endif
  return dim == 3 ? &any_3 : &any_2;
}

/* Rows that a thread takes at a time, and the row after those from i on. */
#define ROWS_AT_ONCE 256

static int64_t end_of(int64_t i, int64_t n)
{
  return i + ROWS_AT_ONCE < n ? i + ROWS_AT_ONCE : n;
}

/* y = (high + low) x. */
void dotyk_product_rows(int32_t dim, int32_t n, const int64_t *start, const int32_t *column, const uint16_t *leading,
                        const uint16_t *trailing, const float *low, const double *x, double *y)
{
  const matrix_t a = {start, column, leading, trailing, low};
  const loops_t *loops = loops_for(dim);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; i += ROWS_AT_ONCE) loops->product(i, end_of(i, n), &a, x, y);
}

/* r := r - high x, x in double precision. */
void dotyk_subtract_product_rows(int32_t dim, int32_t n, const int64_t *start, const int32_t *column,
                                 const uint16_t *leading, const uint16_t *trailing, const double *x, float *r)
{
  const matrix_t a = {start, column, leading, trailing, NULL};
  const loops_t *loops = loops_for(dim);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; i += ROWS_AT_ONCE) loops->subtract(i, end_of(i, n), &a, x, r);
}

/* r = b - high x; with the upper halves of high alone where whole is 0. */
void dotyk_residual_rows(int32_t dim, int32_t n, const int64_t *start, const int32_t *column, const uint16_t *leading,
                         const uint16_t *trailing, int32_t whole, const float *b, const float *x, float *r)
{
  const matrix_t a = {start, column, leading, trailing, NULL};
  const loops_t *loops = loops_for(dim);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; i += ROWS_AT_ONCE) loops->residual(i, end_of(i, n), &a, whole, b, x, r);
}

/* p := c p + d D^-1 (b - high x), next = x + p, with the upper halves of high. */
void dotyk_smooth_rows(int32_t dim, int32_t n, const int64_t *start, const int32_t *column, const uint16_t *leading,
                       const float *inverse, float c, float d, const float *b, const float *x, float *p, float *next)
{
  const matrix_t a = {start, column, leading, NULL, NULL};
  const loops_t *loops = loops_for(dim);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; i += ROWS_AT_ONCE) loops->smooth(i, end_of(i, n), &a, inverse, c, d, b, x, p, next);
}
