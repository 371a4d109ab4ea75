/* Triangular solves of one right-hand side with panels of a supernodal Cholesky factor: the loops of
 * dotyk_linalg_ordered_solve. The order of all operations is fixed, without fused multiplication and addition: the
 * digits are those of any processor and any partition of the rows. */
#include <stdint.h>
#include <string.h>

typedef double eight_t __attribute__((vector_size(64)));

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FASTEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define FASTEST
#endif

#define SUM(a) (((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7])))

/* x := L^-1 x with the lower triangle of m columns. */
FASTEST void dotyk_panel_solve(int64_t m, int64_t lead, const double *l, double *restrict x)
{
  for (int64_t j = 0; j < m; j++) {
    const double *c = l + j*lead;
    double s = x[j] /= c[j];
    for (int64_t i = j + 1; i < m; i++) x[i] -= c[i]*s;
  }
}
/* x := L^-T x. */
FASTEST void dotyk_panel_solve_back(int64_t m, int64_t lead, const double *l, double *restrict x)
{
  for (int64_t j = m - 1; j >= 0; j--) {
    const double *c = l + j*lead;
    double s[4] = {0, 0, 0, 0};
    int64_t i = j + 1;
    for (; i + 3 < m; i += 4)
      for (int q = 0; q < 4; q++) s[q] += c[i + q]*x[i + q];
    for (; i < m; i++) s[0] += c[i]*x[i];
    x[j] = (x[j] - ((s[0] + s[1]) + (s[2] + s[3])))/c[j];
  }
}
/* y := y - L x for the rows first to last - 1 of m columns. */
FASTEST void dotyk_panel_subtract(int64_t m, int64_t lead, const double *l, const double *restrict x, int64_t first,
                                 int64_t last, double *restrict y)
{
  int64_t j = 0;
  for (; j + 3 < m; j += 4) {
    const double *a = l + j*lead, *b = a + lead, *c = b + lead, *d = c + lead;
    const double p = x[j], q = x[j + 1], r = x[j + 2], s = x[j + 3];
    for (int64_t i = first; i < last; i++) y[i] -= (a[i]*p + b[i]*q) + (c[i]*r + d[i]*s);
  }
  for (; j < m; j++) {
    const double *a = l + j*lead;
    const double p = x[j];
    for (int64_t i = first; i < last; i++) y[i] -= a[i]*p;
  }
}
/* s = L^T y over the rows first to last - 1 of m columns. */
FASTEST void dotyk_panel_products(int64_t m, int64_t lead, const double *l, int64_t first, int64_t last,
                                 const double *restrict y, double *restrict s)
{
  for (int64_t j = 0; j < m; j += 4) {
    const double *a = l + j*lead, *b = j + 1 < m ? a + lead : a, *c = j + 2 < m ? b + lead : a,
      *d = j + 3 < m ? c + lead : a;
    eight_t p = {0}, q = {0}, r = {0}, t = {0}, v, w;
    int64_t i = first;
    for (; i + 7 < last; i += 8) {
      memcpy(&w, y + i, sizeof w);
      memcpy(&v, a + i, sizeof v); p += v*w;
      memcpy(&v, b + i, sizeof v); q += v*w;
      memcpy(&v, c + i, sizeof v); r += v*w;
      memcpy(&v, d + i, sizeof v); t += v*w;
    }
    for (; i < last; i++) {
      p[0] += a[i]*y[i];
      q[0] += b[i]*y[i];
      r[0] += c[i]*y[i];
      t[0] += d[i]*y[i];
    }
    s[j] = SUM(p);
    if (j + 1 < m) s[j + 1] = SUM(q);
    if (j + 2 < m) s[j + 2] = SUM(r);
    if (j + 3 < m) s[j + 3] = SUM(t);
  }
}
