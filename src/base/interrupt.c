/* Signals that ask the program to stop, and child processes.
 *
 * SIGINT, SIGTERM, SIGHUP and SIGUSR1 set a flag, which the program checks at each step; a second signal ends the program
 * at once. A signal that is ignored when the program starts (nohup) stays ignored. The signals are passed on to a running
 * child process, which does not outlive the program. SIGUSR1 is what mpirun hands on to its ranks without ending them. */
#define _GNU_SOURCE
#include <errno.h>
#include <signal.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif

static const int asking[] = {SIGINT, SIGTERM, SIGHUP, SIGUSR1};
enum { n_asking = sizeof asking / sizeof *asking };

static volatile sig_atomic_t signal_number; /* the first signal received; 0: none */
static volatile sig_atomic_t child;         /* running child process; 0: none */
static struct timespec first_time;

/* Signals within this time count as one: timeout(1) and batch systems signal both the process and its group. */
static const double same_time = 1; /* [s] */

static void on_signal(int number) {
  int saved = errno;
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (signal_number == 0) {
    first_time = now;
    signal_number = number;
    if (child > 0) kill((pid_t)child, number);
    static const char text[] = "\r\033[Kinterrupted: ends after the current step with the results so far; again: at once\n";
    if (number == SIGINT && isatty(STDERR_FILENO) && write(STDERR_FILENO, text, sizeof text - 1) < 0) errno = saved;
  } else if ((double)(now.tv_sec - first_time.tv_sec) + 1e-9 * (double)(now.tv_nsec - first_time.tv_nsec) > same_time) {
    if (child > 0) kill((pid_t)child, SIGKILL);
    signal(number, SIG_DFL);
    raise(number); /* pending until the handler returns */
  }
  errno = saved;
}

/* Install the handlers. SIGXFSZ and SIGPIPE are ignored, so that a file above the size limit and a closed pipe give an
 * error of the write, as a full disk does. */
void dotyk_watch_interrupts(void) {
  struct sigaction action, before;
  memset(&action, 0, sizeof action);
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (int i = 0; i < n_asking; i++) {
    sigaction(asking[i], NULL, &before);
    if (before.sa_handler != SIG_IGN) sigaction(asking[i], &action, NULL);
  }
  signal(SIGXFSZ, SIG_IGN);
  signal(SIGPIPE, SIG_IGN);
}

/* Number of the first signal received; 0: none. */
int dotyk_interrupt_signal(void) { return signal_number; }

/* For tests: set the first signal received, or 0. */
void dotyk_set_interrupt(int number) {
  clock_gettime(CLOCK_MONOTONIC, &first_time);
  signal_number = number;
}

int dotyk_confine(const char *folder);

/* Run a shell command and wait for its end; confined to a folder (confinement.c) unless that is NULL. Its exit status;
 * 128 + n: ended by signal n; 127: no shell; 125: confinement is not possible here. */
int dotyk_run_command(const char *command, const char *folder) {
  /* Signals between fork and exec are blocked until the child has the default handlers. */
  sigset_t ours, before;
  sigemptyset(&ours);
  for (int i = 0; i < n_asking; i++) sigaddset(&ours, asking[i]);
  sigprocmask(SIG_BLOCK, &ours, &before);
  pid_t parent = getpid(), id = fork();
  if (id < 0) {
    sigprocmask(SIG_SETMASK, &before, NULL);
    return 127;
  }
  if (id == 0) {
    for (int i = 0; i < n_asking; i++) {
      struct sigaction now;
      sigaction(asking[i], NULL, &now);
      if (now.sa_handler != SIG_IGN) signal(asking[i], SIG_DFL);
    }
    signal(SIGPIPE, SIG_DFL);
#ifdef __linux__
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127);
#endif
    sigprocmask(SIG_SETMASK, &before, NULL);
    if (folder && !dotyk_confine(folder)) _exit(125);
    execl("/bin/sh", "sh", "-c", command, (char *)NULL);
    _exit(127);
  }
  child = (sig_atomic_t)id;
  sigprocmask(SIG_SETMASK, &before, NULL);
  if (signal_number) kill(id, signal_number); /* received while signals were blocked */
  int status = 0;
  while (waitpid(id, &status, 0) < 0) {
    if (errno != EINTR) {
      child = 0;
      return 127;
    }
  }
  child = 0;
  if (WIFSIGNALED(status)) return 128 + WTERMSIG(status);
  return WEXITSTATUS(status);
}
