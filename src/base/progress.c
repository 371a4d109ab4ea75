/* Progress of long stages: a thread of its own shows the stage of work, its share that is done and the time left.
 *
 * On a terminal it rewrites one line; elsewhere it prints a line where a stage takes long, and then ever more seldom. Work
 * is counted by atomic additions, from any thread; all output of the program passes the lock of this file, so that nothing
 * is printed at the same time. */
#define _GNU_SOURCE
#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { stage_length = 200, line_length = 300, stack_bytes = 256 * 1024 };
static const double first_line = 0.5; /* time from which on a stage is shown on a terminal [s] */
static const double redraw = 0.25;    /* time between lines there, and between looks at the clock elsewhere [s] */
static const double longest = 600;    /* longest time between lines elsewhere [s] */
static const double told[2] = {60, 2}; /* time after a line of somebody else about this stage, elsewhere and there [s] */
static const double least_share = 0.05; /* done share from which on the time left is told */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t wake;
static pthread_t watcher;
static int is_running, is_stopping, is_terminal; /* under the lock */
static int is_live;                              /* whether the last output is a live line */
static double patience;                          /* time of a stage before its first line elsewhere [s] */
static char stage[stage_length];
static double stage_start, next_line; /* [s] */
static long long done, total;         /* atomic */

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* 0, or errno. */
static int put(int descriptor, const char *text, long length) {
  while (length > 0) {
    ssize_t n = write(descriptor, text, (size_t)length);
    if (n < 0 && errno != EINTR) return errno;
    if (n > 0) {
      text += n;
      length -= n;
    }
  }
  return 0;
}

static void clear_live(void) {
  if (is_live) put(1, "\r\033[2K", 5);
  is_live = 0;
}

/* Time in a convenient unit. */
static const char *duration(double seconds, char *text, size_t length) {
  if (seconds < 100)
    snprintf(text, length, "%.0f s", seconds);
  else if (seconds < 6000)
    snprintf(text, length, "%.0f min", seconds / 60);
  else
    snprintf(text, length, "%.1f h", seconds / 3600);
  return text;
}

/* The line of progress of the current stage. */
static void compose(char *line, double elapsed) {
  char spent[32], left[32];
  long long all = __atomic_load_n(&total, __ATOMIC_RELAXED), part = __atomic_load_n(&done, __ATOMIC_RELAXED);
  double share = all > 0 ? (double)(part < all ? part : all) / (double)all : 0;
  duration(elapsed, spent, sizeof spent);
  if (all <= 0)
    snprintf(line, line_length, "  progress         %s: %s", stage, spent);
  else if (share < least_share)
    snprintf(line, line_length, "  progress         %s: %.0f %%, %s", stage, 100 * share, spent);
  else
    snprintf(line, line_length, "  progress         %s: %.0f %%, %s, remaining %s", stage, 100 * share, spent,
             duration(elapsed * (1 - share) / share, left, sizeof left));
}

/* Show a line, if it is time to. Under the lock. */
static void show(void) {
  char line[line_length + 8];
  double time = now();
  if (!stage[0] || time < next_line) return;
  if (is_terminal) {
    memcpy(line, "\r\033[2K", 5);
    compose(line + 5, time - stage_start);
    put(1, line, (long)strlen(line));
    is_live = 1;
    next_line = time;
  } else {
    compose(line, time - stage_start);
    strcat(line, "\n");
    put(1, line, (long)strlen(line));
    double pause = time - stage_start;
    next_line = time + (pause < longest ? pause : longest);
  }
}

static void *watch(void *nothing) {
  pthread_mutex_lock(&lock);
  while (!is_stopping) {
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_nsec += (long)(1e9 * redraw);
    until.tv_sec += until.tv_nsec / 1000000000;
    until.tv_nsec %= 1000000000;
    pthread_cond_timedwait(&wake, &lock, &until);
    if (!is_stopping) show();
  }
  pthread_mutex_unlock(&lock);
  return nothing;
}

/* Start to watch. Nothing happens where the system has no thread for it. */
void dotyk_progress_start(int terminal, double seconds) {
  pthread_attr_t attributes;
  pthread_condattr_t clock;
  sigset_t all, before;
  if (is_running) return;
  is_terminal = terminal;
  patience = terminal ? first_line : seconds;
  is_stopping = 0;
  stage[0] = 0;
  pthread_condattr_init(&clock);
  pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
  pthread_cond_init(&wake, &clock);
  pthread_condattr_destroy(&clock);
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_bytes > PTHREAD_STACK_MIN ? stack_bytes : PTHREAD_STACK_MIN);
  /* Signals are for the threads that work. */
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, &before);
  is_running = pthread_create(&watcher, &attributes, watch, NULL) == 0;
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  pthread_attr_destroy(&attributes);
}

/* End: the live line is cleared. */
void dotyk_progress_stop(void) {
  if (!is_running) return;
  pthread_mutex_lock(&lock);
  is_stopping = 1;
  pthread_cond_signal(&wake);
  pthread_mutex_unlock(&lock);
  pthread_join(watcher, NULL);
  pthread_cond_destroy(&wake);
  clear_live();
  is_running = 0;
}

/* Another stage begins; its work is not known yet. */
void dotyk_progress_stage(const char *text) {
  pthread_mutex_lock(&lock);
  snprintf(stage, sizeof stage, "%s", text);
  stage_start = now();
  next_line = stage_start + patience;
  __atomic_store_n(&total, 0, __ATOMIC_RELAXED);
  __atomic_store_n(&done, 0, __ATOMIC_RELAXED);
  clear_live();
  pthread_mutex_unlock(&lock);
}

/* Work of the current stage, in any unit; nothing is done yet. */
void dotyk_progress_expect(double work) {
  __atomic_store_n(&done, 0, __ATOMIC_RELAXED);
  __atomic_store_n(&total, work < 9e18 ? (long long)work : 0, __ATOMIC_RELAXED);
}

/* Some of it is done. */
void dotyk_progress_add(double work) { __atomic_fetch_add(&done, (long long)work, __ATOMIC_RELAXED); }

/* Write a whole text to the standard output (1) or error (2). 0, or errno, which Fortran's FLUSH does not report. live:
 * whether the text is a line of progress, which silences the thread for a while, and on a terminal is to be replaced. */
int dotyk_print(int descriptor, const char *text, long length, int live) {
  pthread_mutex_lock(&lock);
  clear_live();
  int status = put(descriptor, text, length);
  if (live) next_line = now() + told[is_terminal];
  is_live = live && is_terminal;
  pthread_mutex_unlock(&lock);
  return status;
}
