/* Residual r = b - K x of straight isotropic tet10, matrix-free: eight elements at a time from their inverse Jacobians,
 * then node by node in a fixed order. For the benchmark of p-multigrid, which compares it with assembled blocks. */
#include <omp.h>
#include <stdint.h>
#include <string.h>

#define LANES 8
typedef float lanes_t __attribute__((vector_size(4*LANES)));

/* Of eight elements: nodes from 0, d xi_m / d x_j, and the weight of a point times lambda and mu. */
typedef struct {
  int32_t node[10][LANES];
  float inverse[3][3][LANES];
  float lambda[LANES], mu[LANES];
} group_t;

static const int edge[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {2, 3}, {1, 3}};

/* Bytes of a group, for the allocation. */
int64_t dotyk_group_bytes(void) { return sizeof(group_t); }

/* Fill the groups; lanes without an element have weight 0. */
void dotyk_fill_groups(int32_t n_elements, const int32_t *node, const double *x, double lambda, double mu, group_t *group)
{
  #pragma omp parallel for
  for (int32_t e = 0; e < (n_elements + LANES - 1)/LANES*LANES; e++) {
    group_t *g = group + e/LANES;
    const int l = e % LANES;
    const int32_t *own = node + 10*(int64_t)(e < n_elements ? e : n_elements - 1);
    double j[3][3], c[3][3];
    for (int a = 0; a < 10; a++) g->node[a][l] = own[a] - 1;
    for (int m = 0; m < 3; m++)
      for (int k = 0; k < 3; k++) j[k][m] = x[3*(own[m + 1] - 1) + k] - x[3*(own[0] - 1) + k];
    for (int m = 0; m < 3; m++)
      for (int k = 0; k < 3; k++)
        c[m][k] = j[(k + 1) % 3][(m + 1) % 3]*j[(k + 2) % 3][(m + 2) % 3] - j[(k + 1) % 3][(m + 2) % 3]*j[(k + 2) % 3][(m + 1) % 3];
    const double det = j[0][0]*c[0][0] + j[1][0]*c[0][1] + j[2][0]*c[0][2];
    for (int m = 0; m < 3; m++)
      for (int k = 0; k < 3; k++) g->inverse[m][k][l] = c[m][k]/det;
    g->lambda[l] = e < n_elements ? lambda*det/24 : 0;
    g->mu[l] = e < n_elements ? mu*det/24 : 0;
  }
}

/* Gradients of the shape functions at the four points. */
static void gradients(float d[4][10][3])
{
  static const double dl[4][3] = {{-1, -1, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int q = 0; q < 4; q++) {
    double l[4];
    for (int a = 0; a < 4; a++) l[a] = a == q ? 0.5854101966249685 : 0.1381966011250105;
    for (int m = 0; m < 3; m++) {
      for (int a = 0; a < 4; a++) d[q][a][m] = (4*l[a] - 1)*dl[a][m];
      for (int k = 0; k < 6; k++) d[q][4 + k][m] = 4*(l[edge[k][0]]*dl[edge[k][1]][m] + l[edge[k][1]]*dl[edge[k][0]][m]);
    }
  }
}

/* Forces of the elements of one group: (10, 3, LANES). */
#if defined(__x86_64__) && defined(__gnu_linux__)
__attribute__((target_clones("avx2", "default")))
#endif
void dotyk_group_forces(const group_t *g, const float d[4][10][3], const float *x, float *force)
{
  lanes_t u[10][3], f[10][3], inverse[3][3], lambda, mu;
  memset(f, 0, sizeof f);
  memcpy(inverse, g->inverse, sizeof inverse);
  memcpy(&lambda, g->lambda, sizeof lambda);
  memcpy(&mu, g->mu, sizeof mu);
  for (int a = 0; a < 10; a++)
    for (int l = 0; l < LANES; l++)
      for (int c = 0; c < 3; c++) u[a][c][l] = x[3*(int64_t)g->node[a][l] + c];
  for (int q = 0; q < 4; q++) {
    lanes_t s[3][3];
    for (int c = 0; c < 3; c++) {
      lanes_t h[3] = {{0}};
      for (int a = 0; a < 10; a++)
        for (int m = 0; m < 3; m++) h[m] += d[q][a][m]*u[a][c];
      for (int k = 0; k < 3; k++) s[c][k] = (h[0]*inverse[0][k] + h[1]*inverse[1][k]) + h[2]*inverse[2][k];
    }
    const lanes_t trace = lambda*((s[0][0] + s[1][1]) + s[2][2]);
    for (int c = 0; c < 3; c++) {
      for (int k = 0; k < c; k++) s[c][k] = s[k][c] = mu*(s[c][k] + s[k][c]);
      s[c][c] = trace + 2*mu*s[c][c];
    }
    for (int c = 0; c < 3; c++) {
      lanes_t t[3];
      for (int m = 0; m < 3; m++) t[m] = (s[c][0]*inverse[m][0] + s[c][1]*inverse[m][1]) + s[c][2]*inverse[m][2];
      for (int a = 0; a < 10; a++) f[a][c] += (d[q][a][0]*t[0] + d[q][a][1]*t[1]) + d[q][a][2]*t[2];
    }
  }
  memcpy(force, f, sizeof f);
}

/* r = b - K x; held components are not excepted. Entry k of a node is the force at place[k] and the two LANES further. */
void dotyk_element_residual(int32_t n_groups, const group_t *group, int32_t n_nodes, const int32_t *first,
                            const int32_t *place, const float *b, const float *x, float *force, float *r)
{
  float d[4][10][3];
  gradients(d);
  #pragma omp parallel
  {
    #pragma omp for schedule(static)
    for (int32_t g = 0; g < n_groups; g++) dotyk_group_forces(group + g, (const float (*)[10][3])d, x, force + (int64_t)30*LANES*g);
    #pragma omp for schedule(static)
    for (int32_t i = 0; i < n_nodes; i++) {
      float s0 = 0, s1 = 0, s2 = 0;
      for (int32_t k = first[i]; k < first[i + 1]; k++) {
        const float *p = force + place[k];
        s0 += p[0];
        s1 += p[LANES];
        s2 += p[2*LANES];
      }
      r[3*(int64_t)i] = b[3*(int64_t)i] - s0;
      r[3*(int64_t)i + 1] = b[3*(int64_t)i + 1] - s1;
      r[3*(int64_t)i + 2] = b[3*(int64_t)i + 2] - s2;
    }
  }
}
