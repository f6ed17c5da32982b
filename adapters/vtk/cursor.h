/* cursor.h -- walks through the bytes of a file, in words or in binary values, never beyond the
 * end, and knows the line for messages. */
#ifndef APSM_ADAPTERS_VTK_CURSOR_H
#define APSM_ADAPTERS_VTK_CURSOR_H

#include <charconv>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>

#include "../guard.h"

namespace apsm
{

class cursor
{
  public:
    explicit cursor(std::string_view bytes) : bytes_(bytes) {}

    size_t left() const { return bytes_.size() - at_; }
    size_t line() const { return line_; }

    /* Throws with the present line, or the present byte once binary values have been read. */
    [[noreturn]] void fail(const std::string &text) const
    {
        damaged((binary_ ? "byte " + std::to_string(at_) : "line " + std::to_string(line_)) + ": " +
                text);
    }

    /* ---- text ---- */
    static bool blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

    /* To the next word, over line ends or not; false if there is none. */
    bool skip_blanks(bool over_lines = true)
    {
        while (at_ < bytes_.size() && blank(bytes_[at_]) && (over_lines || bytes_[at_] != '\n'))
            step();
        return at_ < bytes_.size() && (over_lines || bytes_[at_] != '\n');
    }
    /* Empty at the end of the file (or line). */
    std::string_view word(bool over_lines = true)
    {
        if (!skip_blanks(over_lines)) return {};
        const size_t first = at_;
        while (at_ < bytes_.size() && !blank(bytes_[at_])) at_++;
        return bytes_.substr(first, at_ - first);
    }
    /* Without the line end, which is passed. */
    std::string_view rest_of_line()
    {
        const size_t first = at_, end = std::min(bytes_.find('\n', at_), bytes_.size());
        at_ = end;
        if (at_ < bytes_.size()) step();
        const std::string_view rest = bytes_.substr(first, end - first);
        return !rest.empty() && rest.back() == '\r' ? rest.substr(0, rest.size() - 1) : rest;
    }
    double number(const char *what)
    {
        const std::string_view w = word();
        double value;
        if (!parse(w, &value)) fail(expected(what, w));
        return value;
    }
    double finite(const char *what)
    {
        const double value = number(what);
        if (!std::isfinite(value))
            fail(std::string(what) + " is not finite; export the mesh again");
        return value;
    }
    long long integer(const char *what)
    {
        const std::string_view w = word();
        long long value;
        if (!parse(w, &value)) fail(expected(what, w));
        return value;
    }
    /* A number of things of which each takes at least `bytes` bytes of the rest of the file. */
    size_t count(const char *what, size_t bytes)
    {
        return checked_count(integer(what), what, bytes);
    }
    size_t checked_count(long long n, const char *what, size_t bytes) const
    {
        if (n < 0 || static_cast<unsigned long long>(n) > (left() + 1) / bytes)
            fail(std::string(what) + " " + std::to_string(n) +
                 " is more than the file can hold; "
                 "it is cut short or damaged: copy or export it again");
        return static_cast<size_t>(n);
    }

    /* The whole of w as a number, '+' allowed. */
    template <class T> static bool parse(std::string_view w, T *value)
    {
        if (w.size() > 1 && w[0] == '+' && w[1] != '-') w.remove_prefix(1);
        const auto r = std::from_chars(w.data(), w.data() + w.size(), *value);
        if (w.empty() || r.ptr != w.data() + w.size()) return false;
        if constexpr (std::is_floating_point_v<T>)
            if (r.ec == std::errc::result_out_of_range) { /* 1e-400 is 0, 1e400 is not a number */
                *value = small(w) ? 0.0 : HUGE_VAL;
                return true;
            }
        return r.ec == std::errc();
    }
    std::string expected(const char *what, std::string_view found) const
    {
        return std::string("expected ") + what +
               (found.empty() ? ", but the file ends; it is cut short: copy or export it again"
                              : ", found '" + one_line(std::string(found.substr(0, 40))) +
                                    "'; export the mesh again");
    }

    /* ---- binary ---- */
    void begin_binary() { binary_ = true; }
    void end_binary() { binary_ = false; }
    template <class T> T value(bool big_endian)
    {
        T v;
        if (left() < sizeof v) fail("the file ends here; it is cut short: copy or export it again");
        char raw[sizeof v];
        for (size_t b = 0; b < sizeof v; b++)
            raw[big_endian ? sizeof v - 1 - b : b] = bytes_[at_ + b];
        std::memcpy(&v, raw, sizeof v);
        at_ += sizeof v;
        return v;
    }
    void skip(size_t n)
    {
        if (left() < n) fail("the file ends here; it is cut short: copy or export it again");
        at_ += n;
    }

  private:
    void step()
    {
        if (bytes_[at_++] == '\n') line_++;
    }
    static bool small(std::string_view w)
    {
        const size_t e = w.find_first_of("eE");
        return e == std::string_view::npos || (e + 1 < w.size() && w[e + 1] == '-');
    }

    std::string_view bytes_;
    size_t at_ = 0, line_ = 1;
    bool binary_ = false;
};

/* Of a corner that a file names by number. */
inline uint32_t checked_corner(const cursor &c, long long index, size_t points)
{
    if (index < 0 || static_cast<unsigned long long>(index) >= points)
        c.fail("a face refers to point " + std::to_string(index) + ", but there are " +
               std::to_string(points) + " (counted from 0); export the mesh again");
    return static_cast<uint32_t>(index);
}

} // namespace apsm
#endif
