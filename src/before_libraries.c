/* Check of the address space before the libraries are loaded: OpenBLAS starts its threads as it is loaded; where their
 * buffers do not fit, it ends the program with a signal, or tries for ever. */
#define _GNU_SOURCE
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#ifdef __linux__
_Noreturn void dotyk_out_of_memory(size_t bytes);
void dotyk_memory(double *used, double *left, int *limit);

/* Address space of a thread: its buffer and its stack [byte]. */
static const size_t room = (size_t)144 << 20;

static int number_of(char **environment, const char *name) {
  size_t length = strlen(name);
  for (; *environment; environment++) {
    const char *entry = *environment;
    if (strncmp(entry, name, length) == 0 && entry[length] == '=') return atoi(entry + length + 1);
  }
  return 0;
}

static void look_for_room(int n_arguments, char **arguments, char **environment) {
  struct rlimit most;
  cpu_set_t set;
  double used, left;
  int limit, threads = 1;
  (void)n_arguments;
  (void)arguments;
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

__attribute__((section(".preinit_array"), used)) static void (*const first)(int, char **, char **) = look_for_room;
#endif
