/* Files that are written under another name first: what tells them from those of other runs, how they are made safe, and what becomes of
 * those that killed runs left behind. */
#define _GNU_SOURCE
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Name of the machine, without what may not be in a name of a file. */
static void machine_name(char *name, size_t length) {
  if (gethostname(name, length) != 0) snprintf(name, length, "localhost");
  name[length - 1] = 0;
  for (char *c = name; *c; c++) {
    if (!isalnum((unsigned char)*c)) *c = '_';
  }
}

/* What this process puts behind a name: ".machine-process". */
void dotyk_own_mark(char *mark, int length) {
  char name[65];
  machine_name(name, sizeof name);
  snprintf(mark, (size_t)length, ".%s-%ld", name, (long)getpid());
}

/* Delete the files path.machine-process.* of processes of this machine that are no more. */
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

/* Have a file on the disk before it gets its name. 0, or why not. */
const char *dotyk_sync_file(const char *path) {
  int file = open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return strerror(errno);
  int failed = fsync(file) != 0 && errno != EINVAL && errno != ENOSYS ? errno : 0;
  close(file);
  return failed ? strerror(failed) : NULL;
}
