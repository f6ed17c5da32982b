/* guard.h -- how the C++ adapters fail: they throw a failure, and the extern "C" face turns it,
 * and whatever else is thrown, into a status and one line that names the file. */
#ifndef APSM_ADAPTERS_GUARD_H
#define APSM_ADAPTERS_GUARD_H

#include <exception>
#include <new>
#include <string>

#include "apsm/context.h"

namespace apsm
{

struct failure {
    apsm_status status;
    std::string text; /* place and remedy; the file's name is put before it */
};

/* A call of the library has failed and said why. */
struct failed_call {
    apsm_status status;
};
inline void check(apsm_status status)
{
    if (status != APSM_OK) throw failed_call{ status };
}

[[noreturn]] inline void damaged(const std::string &text)
{
    throw failure{ APSM_ERR_FORMAT, text };
}

/* Libraries throw paragraphs; messages are lines. */
inline std::string one_line(std::string text)
{
    for (char &c : text)
        if (static_cast<unsigned char>(c) < ' ') c = ' ';
    const size_t first = text.find_first_not_of(' ');
    return first == std::string::npos ? "" : text.substr(first, 400);
}

template <class Work> apsm_status guarded(apsm_context *ctx, const char *path, Work work) noexcept
{
    try {
        try {
            work();
            return APSM_OK;
        } catch (const failure &f) {
            return apsm_fail(ctx, f.status, "%s: %s", path, f.text.c_str());
        } catch (const failed_call &f) {
            return f.status;
        } catch (const std::bad_alloc &) {
            return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory; close other programs", path);
        } catch (const std::exception &e) {
            return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: %s; is it damaged? export it again", path,
                             one_line(e.what()).c_str());
        }
    } catch (...) {
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: cannot be used; export it again", path);
    }
}

} // namespace apsm
#endif
