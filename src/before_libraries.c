/* Checks before the libraries are initialized: OpenBLAS starts its threads as it is loaded; where their buffers do not
 * fit, it ends the program with a signal, or tries for ever. Where stacks are too small, threads cannot be started, or
 * the program ends with a signal in the middle of a run. And OpenBLAS chooses its kernels: for processors that are
 * newer than it those of the oldest, which are up to four times slower. */
#define _GNU_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#ifdef __linux__
_Noreturn void dotyk_out_of_memory(size_t bytes);
void dotyk_memory(double *used, double *left, int *limit);

/* Address space of a thread: its buffer and its stack [byte]. */
static const size_t room = (size_t)144 << 20;

/* Stack that each thread needs [byte]: four times what runs were seen to take. */
static const double stack = 512 * 1024;

/* End the program: stacks are too small, by a setting, which is cured by an advice. */
static _Noreturn void refuse_stack(const char *setting, double bytes, const char *advice) {
  char text[300];
  int n = snprintf(text, sizeof text, "%s makes stacks of %.4g kiB; dotyk needs %g kiB at least: %s\n", setting,
                   bytes / 1024, stack / 1024, advice);
  if (n >= (int)sizeof text) n = sizeof text - 1;
  if (write(STDERR_FILENO, text, (size_t)n) < 0) _exit(5);
  _exit(5);
}

/* Look at the size of stacks that the environment asks for: a number of kiB, or with one of the units B, K, M, G. Others
 * are left to the library of OpenMP, which ignores them. */
static void look_at_stacks(char **environment) {
  static const char *const names[] = {"OMP_STACKSIZE", "GOMP_STACKSIZE"};
  struct rlimit most;
  if (getrlimit(RLIMIT_STACK, &most) == 0 && most.rlim_cur != RLIM_INFINITY && (double)most.rlim_cur < stack)
    refuse_stack("ulimit -s", (double)most.rlim_cur, "ulimit -s 8192");
  for (; *environment; environment++) {
    for (int i = 0; i < 2; i++) {
      size_t length = strlen(names[i]);
      if (strncmp(*environment, names[i], length) != 0 || (*environment)[length] != '=') continue;
      char *end;
      double bytes = strtod(*environment + length + 1, &end);
      while (*end == ' ') end++;
      switch (*end | ' ') {
      case 'b': break;
      case 'm': bytes *= 1048576; break;
      case 'g': bytes *= 1073741824; break;
      default: bytes *= 1024;
      }
      if (bytes > 0 && bytes < stack) refuse_stack(*environment, bytes, "unset it, or make it 8M");
    }
  }
}

static int number_of(char **environment, const char *name) {
  size_t length = strlen(name);
  for (; *environment; environment++) {
    const char *entry = *environment;
    if (strncmp(entry, name, length) == 0 && entry[length] == '=') return atoi(entry + length + 1);
  }
  return 0;
}

#ifdef __x86_64__
/* Functions of OpenBLAS with kernels for several processors; others do not have them. */
__attribute__((weak)) void gotoblas_dynamic_init(void);
__attribute__((weak)) void gotoblas_dynamic_quit(void);
__attribute__((weak)) char *openblas_get_corename(void);

/* Choose the kernels by what the processor can do, where OpenBLAS does not know it and the user has not chosen. */
static void choose_kernels(char **environment) {
  static const char key[] = "OPENBLAS_CORETYPE";
  if (!gotoblas_dynamic_init || !gotoblas_dynamic_quit || !openblas_get_corename) return;
  for (; *environment; environment++)
    if (strncmp(*environment, key, sizeof key - 1) == 0 && (*environment)[sizeof key - 1] == '=') return;
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return;
  gotoblas_dynamic_init();
  if (strcmp(openblas_get_corename(), "Prescott") != 0) return;
  gotoblas_dynamic_quit();
  int has_512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  setenv(key, has_512 ? "SkylakeX" : "Haswell", 0);
  gotoblas_dynamic_init();
}
#endif

static void look_at_machine(int n_arguments, char **arguments, char **environment) {
  struct rlimit most;
  cpu_set_t set;
  double used, left;
  int limit, threads = 1;
  (void)n_arguments;
  (void)arguments;
  look_at_stacks(environment);
#ifdef __x86_64__
  choose_kernels(environment);
#endif
  if (getrlimit(RLIMIT_AS, &most) != 0 || most.rlim_cur == RLIM_INFINITY) return;
  if (sched_getaffinity(0, sizeof set, &set) == 0) threads = CPU_COUNT(&set);
  int wanted = number_of(environment, "OPENBLAS_NUM_THREADS");
  if (wanted <= 0) wanted = number_of(environment, "OMP_NUM_THREADS");
  if (wanted > 0 && wanted < threads) threads = wanted;
  dotyk_memory(&used, &left, &limit);
  if ((double)room * threads <= left) return;
  static const char text[] = "OpenBLAS, which dotyk uses, takes 128 MiB of addresses for each of its threads; "
                             "OPENBLAS_NUM_THREADS=1 makes it take less\n";
  if (threads > 1 && write(STDERR_FILENO, text, sizeof text - 1) < 0) _exit(5);
  dotyk_out_of_memory(room * (size_t)threads);
}

__attribute__((section(".preinit_array"), used)) static void (*const first)(int, char **, char **) = look_at_machine;
#endif
