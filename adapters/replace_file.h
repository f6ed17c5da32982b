/* replace_file.h -- files that are either the old or the new one, never half of it: the bytes go
 * to a temporary name in the same folder, to the disk, and only then to their name. */
#ifndef APSM_ADAPTERS_REPLACE_FILE_H
#define APSM_ADAPTERS_REPLACE_FILE_H

#include <string>

namespace apsm
{

/* The temporary file exists (empty) from construction to commit; it has the extension of path,
 * since writers choose their format by it.  Without a commit it is removed.  All throw failure. */
class replacement
{
  public:
    explicit replacement(const std::string &path, const std::string &extension);
    ~replacement();
    replacement(const replacement &) = delete;
    replacement &operator=(const replacement &) = delete;

    const std::string &temporary() const { return temporary_; }
    void write(const std::string &bytes) const;
    void commit(); /* fsync, rename, fsync of the folder */

  private:
    std::string path_, folder_, temporary_;
    bool done_ = false;
};

} // namespace apsm
#endif
