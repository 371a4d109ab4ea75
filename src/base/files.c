/* Files that are written under a temporary name first: names that no other run uses, synchronization with the disk,
 * and removal of the files that killed runs left behind. Also tests of paths, and printing. */
#define _GNU_SOURCE
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Host name, with an underscore for each character that a file name must not contain. */
static void machine_name(char *name, size_t length) {
  if (gethostname(name, length) != 0) snprintf(name, length, "localhost");
  name[length - 1] = 0;
  for (char *c = name; *c; c++) {
    if (!isalnum((unsigned char)*c)) *c = '_';
  }
}

/* Suffix of the temporary files of this process: ".machine-process". */
void dotyk_own_mark(char *mark, int length) {
  char name[65];
  machine_name(name, sizeof name);
  snprintf(mark, (size_t)length, ".%s-%ld", name, (long)getpid());
}

/* Delete the files path.machine-process.* of processes of this machine that have ended. */
void dotyk_remove_leftovers(const char *path) {
  char name[65], start[600], file[1200];
  machine_name(name, sizeof name);
  const char *slash = strrchr(path, '/');
  const char *base = slash ? slash + 1 : path;
  int folder_length = (int)(base - path);
  if (snprintf(start, sizeof start, "%s.%s-", base, name) >= (int)sizeof start) return;
  if (snprintf(file, sizeof file, "%.*s.", folder_length, path) >= (int)sizeof file) return;
  DIR *folder = opendir(file);
  if (!folder) return;
  for (struct dirent *entry = readdir(folder); entry; entry = readdir(folder)) {
    if (strncmp(entry->d_name, start, strlen(start)) != 0) continue;
    char *end;
    long process = strtol(entry->d_name + strlen(start), &end, 10);
    if (end == entry->d_name + strlen(start) || *end != '.' || process <= 0) continue;
    if (kill((pid_t)process, 0) == 0 || errno != ESRCH) continue;
    if (snprintf(file, sizeof file, "%.*s%s", folder_length, path, entry->d_name) < (int)sizeof file) unlink(file);
  }
  closedir(folder);
}

/* Flush a file to the disk, before it gets its final name. NULL, or the reason of the failure. */
const char *dotyk_sync_file(const char *path) {
  int file = open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return strerror(errno);
  int failed = fsync(file) != 0 && errno != EINVAL && errno != ENOSYS ? errno : 0;
  close(file);
  return failed ? strerror(failed) : NULL;
}

/* Kind of a path: 0 regular file, 1 missing, 2 directory, 3 pipe, 4 device or other, 5 no permission to look.
 * Called before a file is opened: opening a pipe waits for a writer, maybe for ever. */
int dotyk_path_kind(const char *path) {
  struct stat status;
  if (stat(path, &status) != 0) return errno == EACCES ? 5 : 1;
  if (S_ISREG(status.st_mode)) return 0;
  if (S_ISDIR(status.st_mode)) return 2;
  return S_ISFIFO(status.st_mode) ? 3 : 4;
}

/* Whether a file exists and is write-protected. */
int dotyk_is_protected(const char *path) { return access(path, F_OK) == 0 && access(path, W_OK) != 0; }

/* Open /dev/null for each standard stream that is closed. Otherwise the next file that is opened gets its descriptor
 * and all that is printed: with `dotyk case.nml >&-` the results file. */
void dotyk_hold_standard_files(void) {
  for (int i = 0; i < 3; i++) {
    if (fcntl(i, F_GETFD) == -1 && errno == EBADF && open("/dev/null", i == 0 ? O_WRONLY : O_RDONLY) != i) return;
  }
}

/* Path of the file behind symbolic links; the path itself where it is no link. */
void dotyk_behind_links(const char *path, char *target, int length) {
  enum { longest_chain = 16 };
  char next[4096];
  snprintf(target, (size_t)length, "%s", path);
  for (int i = 0; i < longest_chain; i++) {
    ssize_t n = readlink(target, next, sizeof next - 1);
    if (n < 0) return;
    next[n] = 0;
    char *slash = next[0] == '/' ? NULL : strrchr(target, '/');
    size_t start = slash ? (size_t)(slash + 1 - target) : 0;
    snprintf(target + start, (size_t)length - start, "%s", next);
  }
}

/* Whether files of this user may be kept in a folder: it can be written, it and a link that leads there belong to this
 * user or to the owner of `beside` (NULL: to this user alone), and not everybody can write it. */
int dotyk_is_trusted_folder(const char *folder, const char *beside) {
  struct stat link, target, other;
  uid_t owner = geteuid();
  if (beside && stat(beside[0] ? beside : ".", &other) == 0) owner = other.st_uid;
  if (lstat(folder, &link) != 0 || stat(folder, &target) != 0 || !S_ISDIR(target.st_mode)) return 0;
  if (link.st_uid != geteuid() && link.st_uid != owner) return 0;
  if (target.st_uid != geteuid() && target.st_uid != owner) return 0;
  return !(target.st_mode & S_IWOTH) && access(folder, W_OK | X_OK) == 0;
}

/* Number of this user. */
int dotyk_user(void) { return (int)geteuid(); }

/* Write a text to a new file; nothing happens where the name is taken, be it by a link that leads nowhere. */
void dotyk_write_new(const char *path, const char *text) {
  int file = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return;
  if (write(file, text, strlen(text)) < 0) unlink(path);
  close(file);
}
