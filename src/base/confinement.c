/* Confinement of a child process, for geometries of others: gmsh runs shell commands that a geometry contains.
 *
 * A confined process starts no other process (a seccomp filter: only threads can be made) and, where the kernel has
 * Landlock (Linux 5.13), creates, changes and deletes files below one folder only. Both hold until it ends, and no
 * program gains privileges any more. */
#define _GNU_SOURCE
#include <stddef.h>

#ifdef __linux__
#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <stdint.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#if defined(__x86_64__)
#define NATIVE AUDIT_ARCH_X86_64
#elif defined(__aarch64__)
#define NATIVE AUDIT_ARCH_AARCH64
#endif
#endif

#ifdef NATIVE
#define LOAD(field) BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, field))
#define RETURN(value) BPF_STMT(BPF_RET | BPF_K, value)
#define REFUSE(number) RETURN(SECCOMP_RET_ERRNO | (number))
#define IF_NOT_EQUAL_SKIP(value, n) BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, n)

/* Whether no process can be started any more. */
static int refuse_processes(void) {
  static struct sock_filter filter[] = {
      LOAD(arch),
      IF_NOT_EQUAL_SKIP(NATIVE, 1),
      BPF_JUMP(BPF_JMP | BPF_JA, 1, 0, 0),
      REFUSE(EPERM), /* system calls of another architecture have other numbers */
      LOAD(nr),
#ifdef __x86_64__
      BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, 0x40000000, 0, 1), /* so have those of x32 */
      REFUSE(EPERM),
      IF_NOT_EQUAL_SKIP(SYS_fork, 1),
      REFUSE(EPERM),
      IF_NOT_EQUAL_SKIP(SYS_vfork, 1),
      REFUSE(EPERM),
#endif
#ifdef SYS_clone3
      /* Its flags are in memory, where a filter cannot look; the C library goes on with clone. */
      IF_NOT_EQUAL_SKIP(SYS_clone3, 1),
      REFUSE(ENOSYS),
#endif
      IF_NOT_EQUAL_SKIP(SYS_clone, 3),
      LOAD(args[0]), /* the lower word of its flags: both machines are little endian */
      BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, CLONE_THREAD, 1, 0),
      REFUSE(EPERM),
      RETURN(SECCOMP_RET_ALLOW),
  };
  static struct sock_fprog program = {sizeof filter / sizeof *filter, filter};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
}

/* Allow changes of files below a folder only, where the kernel can. */
static void keep_to_folder(const char *folder) {
#ifdef SYS_landlock_create_ruleset
  struct landlock_ruleset_attr rules = {
      .handled_access_fs = LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                           LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_CHAR | LANDLOCK_ACCESS_FS_MAKE_DIR |
                           LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_MAKE_SOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO |
                           LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_SYM};
  struct landlock_path_beneath_attr below = {.allowed_access = rules.handled_access_fs};
  int set = (int)syscall(SYS_landlock_create_ruleset, &rules, sizeof rules, 0);
  if (set < 0) return;
  below.parent_fd = open(folder[0] ? folder : ".", O_PATH | O_DIRECTORY | O_CLOEXEC);
  if (below.parent_fd >= 0 && syscall(SYS_landlock_add_rule, set, LANDLOCK_RULE_PATH_BENEATH, &below, 0) == 0)
    syscall(SYS_landlock_restrict_self, set, 0);
  if (below.parent_fd >= 0) close(below.parent_fd);
  close(set);
#else
  (void)folder;
#endif
}
#endif

/* Confine this process to changes below a folder, without new processes. Whether that is possible here. */
int dotyk_confine(const char *folder) {
#ifdef NATIVE
  if (!refuse_processes()) return 0;
  keep_to_folder(folder);
  return 1;
#else
  (void)folder;
  return 0;
#endif
}
