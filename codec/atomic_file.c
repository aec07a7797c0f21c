/* Files that appear whole or not at all: a temporary file beside the target, fsync, rename. */
#include "lathe_codec.h"
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { BUFFER = 1 << 16 };

struct lathe_atomic_file {
    int fd, failure;        /* failure: errno of the first write that failed */
    char *path, *temporary; /* temporary NULL: a device or pipe, written directly */
    size_t filled;
    uint8_t buffer[BUFFER];
};

static lathe_status io_failure(lathe_error *err, const char *path, int number) {
    lathe_status status = number == ENOMEM ? LATHE_ERR_MEMORY : LATHE_ERR_IO;
    return lathe_fail(err, status, "%s: cannot write: %s", path, strerror(number));
}

static void release(lathe_atomic_file *file) {
    free(file->path);
    free(file->temporary);
    free(file);
}

/* ---- open ---- */

/* A short name of its own: the target's may already have the greatest length a name can have. O_EXCL decides between
 * processes and threads; the clock only makes collisions rare. */
static int create_beside(char **name, const char *path) {
    char *copy = strdup(path);
    if (!copy) return -1;
    const char *folder = dirname(copy);
    size_t room = strlen(folder) + 64;
    *name = malloc(room);
    int fd = -1;
    errno = ENOMEM; /* unless open says otherwise */
    for (unsigned attempt = 0; *name && attempt < 1000; attempt++) {
        struct timespec now;
        (void)clock_gettime(CLOCK_REALTIME, &now);
        snprintf(*name, room, "%s/.lathe-%ld-%lx-%u.tmp", folder, (long)getpid(), (unsigned long)now.tv_nsec, attempt);
        fd = open(*name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0 || errno != EEXIST) break;
    }
    int number = errno;
    free(copy);
    if (fd < 0) {
        free(*name);
        *name = NULL;
    }
    errno = number;
    return fd;
}

/* A link stays a link: what it points to is replaced. */
static char *resolve(const char *path) {
    char *target = realpath(path, NULL);
    return target || errno == ENOMEM ? target : strdup(path);
}

static int open_target(lathe_atomic_file *file) {
    struct stat there;
    if (stat(file->path, &there)) return create_beside(&file->temporary, file->path);
    if (S_ISDIR(there.st_mode)) {
        errno = EISDIR;
        return -1;
    }
    /* Replacing /dev/null by a file would be a bad joke. */
    if (!S_ISREG(there.st_mode)) return open(file->path, O_WRONLY | O_CLOEXEC);
    int fd = create_beside(&file->temporary, file->path);
    if (fd >= 0) (void)fchmod(fd, there.st_mode & 0777);
    return fd;
}

lathe_status lathe_atomic_open(lathe_atomic_file **out, const char *path, lathe_error *err) {
    if (!*path) return lathe_fail(err, LATHE_ERR_IO, "cannot write to a file without a name");
    lathe_atomic_file *file = calloc(1, sizeof *file);
    if (file) file->path = resolve(path);
    if (!file || !file->path) {
        free(file);
        return lathe_fail(err, LATHE_ERR_MEMORY, "%s: out of memory", path);
    }
    file->fd = open_target(file);
    if (file->fd < 0) {
        lathe_status status = io_failure(err, path, errno);
        release(file);
        return status;
    }
    *out = file;
    return LATHE_OK;
}

/* ---- write ---- */

static void write_all(lathe_atomic_file *file, const uint8_t *bytes, size_t size) {
    while (size && !file->failure) {
        ssize_t n = write(file->fd, bytes, size);
        if (n <= 0) {
            if (n == 0 || errno != EINTR) file->failure = n ? errno : EIO;
            continue;
        }
        bytes += n;
        size -= (size_t)n;
    }
}

static void flush(lathe_atomic_file *file) {
    write_all(file, file->buffer, file->filled);
    file->filled = 0;
}

int lathe_atomic_write(void *context, const void *bytes, size_t size) {
    lathe_atomic_file *file = context;
    if (size > BUFFER - file->filled) flush(file);
    if (size > BUFFER) {
        write_all(file, bytes, size);
    } else if (size) {
        memcpy(file->buffer + file->filled, bytes, size);
        file->filled += size;
    }
    return file->failure != 0;
}

/* ---- commit, abandon ---- */

/* So that the new name survives a power cut too. Not every file system can; the data is safe by then. */
static void sync_folder(const char *path) {
    char *copy = strdup(path);
    if (!copy) return;
    int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        (void)fsync(fd);
        close(fd);
    }
    free(copy);
}

/* File systems with late allocation (NFS, quotas) tell of a full disk only at fsync or close. */
static int finish_writing(lathe_atomic_file *file) {
    flush(file);
    if (!file->failure && file->temporary && fsync(file->fd)) file->failure = errno;
    if (close(file->fd) && !file->failure && errno != EINTR) file->failure = errno;
    file->fd = -1;
    return file->failure;
}

lathe_status lathe_atomic_commit(lathe_atomic_file **file, lathe_error *err) {
    lathe_atomic_file *f = *file;
    int number = finish_writing(f);
    if (!number && f->temporary && rename(f->temporary, f->path)) number = errno;
    lathe_status status = number ? io_failure(err, f->path, number) : LATHE_OK;
    if (number && f->temporary) (void)unlink(f->temporary);
    if (!number && f->temporary) sync_folder(f->path);
    release(f);
    *file = NULL;
    return status;
}

void lathe_atomic_abandon(lathe_atomic_file **file) {
    if (!file || !*file) return;
    close((*file)->fd);
    if ((*file)->temporary) (void)unlink((*file)->temporary);
    release(*file);
    *file = NULL;
}
