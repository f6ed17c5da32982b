#include "input/picture.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "files/io.h"
#include "formats/input_file.h"
#include "formats/scalar.h"

enum { ENTRY = 12, MOST_ENTRIES = 200, DESCRIPTION = 270, TEXT = 1024 };

/* size bytes at `at`; false if there are fewer. */
static bool read_at(int fd, uint64_t at, void *bytes, size_t size)
{
    return pread(fd, bytes, size, (off_t)at) == (ssize_t)size;
}

static size_t number(const unsigned char *p, size_t size, bool big)
{
    return (size_t)scalar_bits(p, size, big);
}

/* "images=12" or "slices=12", as ImageJ writes of what lies behind the first page. */
static bool tells_slices(int fd, const unsigned char *entry, bool big)
{
    char text[TEXT + 1] = "";
    const size_t length = number(entry + 4, 4, big);
    if (length < 8 ||
        pread(fd, text, length < TEXT ? length : TEXT, (off_t)number(entry + 8, 4, big)) <= 0)
        return false;
    const char *const images = strstr(text, "images="), *const slices = strstr(text, "slices=");
    return (images && strtol(images + 7, NULL, 10) > 1) ||
           (slices && strtol(slices + 7, NULL, 10) > 1);
}

/* The page at `at` is the only one, and all there is. */
static bool is_alone(int fd, uint64_t at, bool big)
{
    unsigned char count[2], entries[MOST_ENTRIES * ENTRY + 4];
    if (!read_at(fd, at, count, 2)) return false;
    const size_t n = number(count, 2, big);
    if (n > MOST_ENTRIES || !read_at(fd, at + 2, entries, n * ENTRY + 4)) return false;
    for (size_t k = 0; k < n; k++)
        if (number(entries + ENTRY * k, 2, big) == DESCRIPTION &&
            tells_slices(fd, entries + ENTRY * k, big))
            return false;
    return number(entries + n * ENTRY, 4, big) == 0;
}

bool picture_is_one(const char *path)
{
    unsigned char head[8];
    int fd;
    if (!path_ends_in(path, ".tif") && !path_ends_in(path, ".tiff")) return false;
    if (apsm_open_regular(NULL, path, &fd) != APSM_OK) return false;
    const bool there = read_at(fd, 0, head, sizeof head);
    const bool big = there && memcmp(head, "MM", 2) == 0;
    const bool is = there && (big || memcmp(head, "II", 2) == 0) &&
                    number(head + 2, 2, big) == 42 && is_alone(fd, number(head + 4, 4, big), big);
    close(fd);
    return is;
}
