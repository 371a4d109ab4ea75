/* Stage of the run for messages, available memory, and the end of the program when memory is exhausted.
 *
 * Nothing here allocates: the code must work when no memory is left. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

/* progress.c */
void dotyk_progress_stage(const char *text);

enum { exit_machine = 5, text_length = 240 };

static char stage[text_length] = "starting";
static _Thread_local char item[text_length];
static volatile int ending;

/* Kinds of limits that dotyk_memory returns. */
enum { NOT_KNOWN = 0, MACHINE = 1, CONTAINER = 2, PROCESS = 3 };

/* Read the beginning of a small file, with a null character at the end. Whether it could be read. */
static int read_small(const char *path, char *text, size_t length) {
  int file = open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return 0;
  ssize_t n = read(file, text, length - 1);
  close(file);
  if (n <= 0) return 0;
  text[n] = 0;
  return 1;
}

/* The number behind a word of a text; -1 where the word is missing or no number follows ("max"). */
static double number_behind(const char *text, const char *word) {
  const char *place = strstr(text, word);
  char *end;
  if (!place) return -1;
  double value = strtod(place + strlen(word), &end);
  return end == place + strlen(word) ? -1 : value;
}

static double number_in(const char *folder, const char *name) {
  char path[600], text[64];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return read_small(path, text, sizeof text) ? number_behind(text, "") : -1;
}

static void take_less(double value, int kind, double *left, int *limit) {
  if (value < 0) value = 0;
  if (*limit == NOT_KNOWN || value < *left) {
    *left = value;
    *limit = kind;
  }
}

/* Memory that a control group and those above it leave, up to the root of the hierarchy that is mounted at `root`; file
 * caches that the kernel gives back count as free. A container may see the root alone of its groups. */
static void look_at_hierarchy(const char *root, char *path, const char *limit_name, const char *usage_name,
                              const char *cache, double *left, int *limit) {
  char folder[560], statistics[4096];
  for (;;) {
    snprintf(folder, sizeof folder, "%s%s", root, path);
    double most = number_in(folder, limit_name), used = number_in(folder, usage_name);
    if (most >= 0 && used >= 0) {
      char name[600];
      snprintf(name, sizeof name, "%s/memory.stat", folder);
      double free_again = read_small(name, statistics, sizeof statistics) ? number_behind(statistics, cache) : 0;
      take_less(most - used + (free_again > 0 ? free_again : 0), CONTAINER, left, limit);
    }
    char *slash = strrchr(path, '/');
    if (!slash || !path[1]) break;
    slash[slash == path ? 1 : 0] = 0;
  }
}

/* Memory that the control groups of a process leave. `list` has its groups as /proc/self/cgroup does, one a line:
 * "0::/path" of version 2, "number:controllers:/path" of version 1; `mount` has the hierarchies. */
void dotyk_groups_memory(const char *list, const char *mount, double *left, int *limit) {
  char text[8192], root[560];
  if (!read_small(list, text, sizeof text)) return;
  for (char *line = text, *next; line && *line; line = next) {
    next = strchr(line, '\n');
    if (next) *next++ = 0;
    char *controllers = strchr(line, ':');
    char *path = controllers ? strchr(controllers + 1, ':') : NULL;
    if (!path) continue;
    *path++ = 0;
    controllers++;
    if (strncmp(line, "0:", 2) == 0 && !*controllers) {
      look_at_hierarchy(mount, path, "memory.max", "memory.current", "inactive_file ", left, limit);
    } else if (strcmp(controllers, "memory") == 0) {
      snprintf(root, sizeof root, "%s/memory", mount);
      look_at_hierarchy(root, path, "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file ", left,
                        limit);
    }
  }
}

/* Memory that this process uses, and memory that it can still get [byte]: the least of what the machine, the container
 * and `ulimit -v` leave; limit says which of them. */
void dotyk_memory(double *used, double *left, int *limit) {
  char text[2048];
  struct rlimit most;
  const double page = (double)sysconf(_SC_PAGESIZE);
  double virtual = 0;
  *used = 0;
  *left = 0;
  *limit = NOT_KNOWN;
  if (read_small("/proc/self/statm", text, sizeof text)) {
    char *end;
    virtual = page * strtod(text, &end);
    *used = page * strtod(end, NULL);
  }
  if (read_small("/proc/meminfo", text, sizeof text)) {
    /* Without swap: a factorization that swaps does not end, and a batch job may not swap. */
    double available = number_behind(text, "MemAvailable:");
    if (available >= 0) take_less(1024 * available, MACHINE, left, limit);
  }
  dotyk_groups_memory("/proc/self/cgroup", "/sys/fs/cgroup", left, limit);
  if (getrlimit(RLIMIT_AS, &most) == 0 && most.rlim_cur != RLIM_INFINITY)
    take_less((double)most.rlim_cur - virtual, PROCESS, left, limit);
}

/* Current stage of the run, for messages. */
void dotyk_set_stage(const char *text) {
  snprintf(stage, sizeof stage, "%s", text);
  dotyk_progress_stage(text);
}
const char *dotyk_stage(void) { return stage; }

/* Object that this thread works on, such as the name of a body; empty: none. */
void dotyk_set_item(const char *text) { snprintf(item, sizeof item, "%s", text); }

static void say(const char *format, ...) {
  char text[1024];
  va_list arguments;
  va_start(arguments, format);
  int n = vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  if (n >= (int)sizeof text) n = sizeof text - 1;
  if (n > 0 && write(STDERR_FILENO, text, (size_t)n) < 0) return;
}

static const char *with_unit(double bytes, char *text, size_t length) {
  if (bytes < 1048576.0) {
    snprintf(text, length, "%.3g kiB", bytes / 1024);
  } else if (bytes < 1073741824.0) {
    snprintf(text, length, "%.3g MiB", bytes / 1048576);
  } else {
    snprintf(text, length, "%.3g GiB", bytes / 1073741824);
  }
  return text;
}

/* Ranks that run out of memory at the same time would all say so: what starts them ends the others with the first, by
 * a signal that is no request for results any more. */
static void wait_for_lower_ranks(void) {
  const char *rank = getenv("OMPI_COMM_WORLD_RANK");
  if (!rank) rank = getenv("PMIX_RANK");
  if (!rank) return;
  int turn = atoi(rank);
  signal(SIGTERM, SIG_DFL);
  usleep(500000u * (unsigned)(turn < 8 ? turn : 8));
}

/* End the program: an allocation of `bytes` failed; 0: of an unknown size, in a library. */
_Noreturn void dotyk_out_of_memory(size_t bytes) {
  static const char *const name[] = {"", "of the machine", "of the container or batch job",
                                     "of the process (ulimit -v)"};
  char wanted[40], in_use[40], rest[40], needed[80] = "", room[120] = "";
  double used, left;
  int limit;
  /* One thread ends the program; the others wait. */
  if (__sync_lock_test_and_set(&ending, 1)) {
    for (;;) pause();
  }
  dotyk_memory(&used, &left, &limit);
  if (bytes > 0)
    snprintf(needed, sizeof needed, ": %s more are needed", with_unit((double)bytes, wanted, sizeof wanted));
  if (limit != NOT_KNOWN)
    snprintf(room, sizeof room, ", %s are left %s", with_unit(left, rest, sizeof rest), name[limit]);
  wait_for_lower_ranks();
  say("out of memory while %s%s%s%s; %s are in use%s\n"
      "no results were written; give it more memory, or take a coarser mesh, fewer threads (--threads) or "
      "linear_solver='iterative' (dotyk --check estimates what a scene takes)\n",
      stage, item[0] ? ", " : "", item, needed, with_unit(used, in_use, sizeof in_use), room);
  _exit(exit_machine);
}

/* A library called exit. The libraries of the compiler do so when memory is exhausted or threads cannot be started,
 * with a message on the standard error. */
static void on_end(int status, void *none) {
  (void)none;
  if (ending || status == 0) return;
  if (status == 1) dotyk_out_of_memory(0);
  say("ended by an error of a library or of dotyk itself while %s%s%s: no results were written; see the lines above\n",
      stage, item[0] ? ", " : "", item);
  _exit(exit_machine);
}

static struct sigaction before_segv, before_bus;
static char other_stack[65536];

/* An invalid address: libraries that do not check their allocations, and stacks that cannot grow. Where hardly any
 * memory is left, its lack is the cause. Otherwise the instruction is repeated under the previous handler (the
 * compiler's, a sanitizer's). */
static void on_bad_address(int number) {
  double used, left;
  int limit;
  dotyk_memory(&used, &left, &limit);
  if (limit != NOT_KNOWN && left < 16 * 1048576.0) dotyk_out_of_memory(0);
  sigaction(number, number == SIGBUS ? &before_bus : &before_segv, NULL);
}

/* From here on an exit without dotyk_end_expected counts as the failure of a library. */
void dotyk_watch_ends(void) {
  struct sigaction action;
  stack_t stack = {.ss_sp = other_stack, .ss_size = sizeof other_stack};
  on_exit(on_end, NULL);
  memset(&action, 0, sizeof action);
  action.sa_handler = on_bad_address;
  action.sa_flags = SA_ONSTACK;
  sigaltstack(&stack, NULL);
  sigaction(SIGSEGV, &action, &before_segv);
  sigaction(SIGBUS, &action, &before_bus);
}
void dotyk_end_expected(void) { ending = 1; }

/* Largest memory that the process has had so far [bytes]; Linux counts in kibibytes. */
double dotyk_peak_memory(void) {
  struct rusage usage;
  return getrusage(RUSAGE_SELF, &usage) == 0 ? 1024.0 * (double)usage.ru_maxrss : 0;
}
