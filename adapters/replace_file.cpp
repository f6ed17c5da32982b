#include "replace_file.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>

#include "guard.h"

namespace apsm
{
namespace
{

[[noreturn]] void fail_io(const char *what)
{
    throw failure{ APSM_ERR_IO, std::string(what) + ": " + std::strerror(errno) +
                                    "; check the folder, its permissions and the space left" };
}

void sync_path(const std::string &path, int flags, const char *what)
{
    const int fd = open(path.c_str(), flags | O_CLOEXEC);
    if (fd < 0) fail_io(what);
    const int failed = fsync(fd);
    const int saved = errno;
    close(fd);
    errno = saved;
    /* Some file systems cannot sync a folder; there the rename is all there is. */
    if (failed && !(errno == EINVAL && (flags & O_DIRECTORY))) fail_io(what);
}

} // namespace

replacement::replacement(const std::string &path, const std::string &extension) : path_(path)
{
    const size_t slash = path.rfind('/');
    folder_ = slash == std::string::npos ? "." : path.substr(0, slash + 1);
    const std::string base = slash == std::string::npos ? path : path.substr(slash + 1);
    const std::string prefix = slash == std::string::npos ? "" : folder_;
    /* O_EXCL keeps threads and processes apart. */
    for (int attempt = 0;; attempt++) {
        temporary_ = prefix + "." + base + "-" + std::to_string(getpid()) + "-" +
                     std::to_string(attempt) + ".tmp" + extension;
        const int fd = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0) {
            close(fd);
            return;
        }
        if (errno != EEXIST || attempt == 1000) fail_io("cannot be written");
    }
}

replacement::~replacement()
{
    if (!done_) unlink(temporary_.c_str());
}

void replacement::write(const std::string &bytes) const
{
    const int fd = open(temporary_.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
    if (fd < 0) fail_io("cannot be written");
    for (size_t done = 0; done < bytes.size();) {
        const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            const int saved = errno;
            close(fd);
            errno = saved;
            fail_io("cannot be written");
        }
        done += static_cast<size_t>(n);
    }
    if (close(fd)) fail_io("cannot be written");
}

void replacement::commit()
{
    sync_path(temporary_, O_WRONLY, "cannot be written to the disk");
    if (rename(temporary_.c_str(), path_.c_str())) fail_io("cannot be put in its place");
    done_ = true;
    sync_path(folder_, O_RDONLY | O_DIRECTORY, "its folder cannot be written to the disk");
}

} // namespace apsm
