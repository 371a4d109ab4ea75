/* Synchronization of gfortran's OpenMP for the thread sanitizer: libgomp is not instrumented, so that its teams,
 * barriers and locks seem to order nothing. Each entry point that the compiler calls reports the order of events to the
 * sanitizer, then calls that of libgomp. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

void __tsan_acquire(void *address);
void __tsan_release(void *address);

#define REAL(name) ((__typeof__(&name))find(#name))

static void *find(const char *name)
{
  void *function = dlsym(RTLD_NEXT, name);
  if (!function) abort();
  return function;
}

/* Tasks that are done: waits and barriers come after them. */
static char tasks_done;

/* A team: what its master did comes before all of it, and all of it before what the master does next. */
struct team { void (*body)(void *); void *data; };

static void run(void *pointer)
{
  struct team *team = pointer;
  __tsan_acquire(team);
  team->body(team->data);
  __tsan_release(team);
}

#define TEAM(call) \
  struct team team = {body, data}; \
  __tsan_release(&team); \
  call; \
  __tsan_acquire(&tasks_done); \
  __tsan_acquire(&team)

void GOMP_parallel(void (*body)(void *), void *data, unsigned threads, unsigned flags)
{
  TEAM(REAL(GOMP_parallel)(run, &team, threads, flags));
}

#define PARALLEL_LOOP(name) \
  void name(void (*body)(void *), void *data, unsigned threads, long start, long end, long step, long chunk, \
            unsigned flags) \
  { \
    TEAM(REAL(name)(run, &team, threads, start, end, step, chunk, flags)); \
  }
PARALLEL_LOOP(GOMP_parallel_loop_dynamic)
PARALLEL_LOOP(GOMP_parallel_loop_guided)
PARALLEL_LOOP(GOMP_parallel_loop_nonmonotonic_dynamic)
PARALLEL_LOOP(GOMP_parallel_loop_nonmonotonic_guided)

/* Barriers, of all teams alike. */
static char barrier;

#define BARRIER(name) \
  void name(void) \
  { \
    __tsan_release(&barrier); \
    REAL(name)(); \
    __tsan_acquire(&tasks_done); \
    __tsan_acquire(&barrier); \
  }
BARRIER(GOMP_barrier)
BARRIER(GOMP_loop_end)

/* Locks. */
#define LOCK(begin, end) \
  static char lock_##begin; \
  void begin(void) { REAL(begin)(); __tsan_acquire(&lock_##begin); } \
  void end(void) { __tsan_release(&lock_##begin); REAL(end)(); }
LOCK(GOMP_critical_start, GOMP_critical_end)
LOCK(GOMP_atomic_start, GOMP_atomic_end)

void GOMP_critical_name_start(void **lock)
{
  REAL(GOMP_critical_name_start)(lock);
  __tsan_acquire(lock);
}

void GOMP_critical_name_end(void **lock)
{
  __tsan_release(lock);
  REAL(GOMP_critical_name_end)(lock);
}

void omp_set_lock_(void *lock)
{
  REAL(omp_set_lock_)(lock);
  __tsan_acquire(lock);
}

void omp_unset_lock_(void *lock)
{
  __tsan_release(lock);
  REAL(omp_unset_lock_)(lock);
}

/* Tasks: what was done before one was made comes before it, and all that are done before what follows the wait. */
struct task { void (*body)(void *); void *memory; void *data; };

static void run_task(void *pointer)
{
  struct task *task = *(struct task **)pointer;
  __tsan_acquire(task);
  task->body(task->data);
  __tsan_release(&tasks_done);
  free(task->memory);
  free(task);
}

void GOMP_task(void (*body)(void *), void *data, void (*copy)(void *, void *), long size, long align, bool now,
               unsigned flags, void **depend, int priority)
{
  struct task *task = malloc(sizeof *task);
  if (!task || !(task->memory = malloc(size + align))) abort();
  task->body = body;
  task->data = (void *)(((uintptr_t)task->memory + align - 1) / align * align);
  if (copy) copy(task->data, data);
  else memcpy(task->data, data, size);
  __tsan_release(task);
  REAL(GOMP_task)(run_task, &task, NULL, sizeof task, _Alignof(struct task *), now, flags, depend, priority);
}

void GOMP_taskwait(void)
{
  REAL(GOMP_taskwait)();
  __tsan_acquire(&tasks_done);
}
