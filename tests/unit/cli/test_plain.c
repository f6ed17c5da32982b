/* Nothing that a file is called or holds reaches the terminal as a command to it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "plain.h"

static void expect(const char *text, const char *wanted)
{
    char *said = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&said, &size);
    cli_put_plain(out, "> ", text);
    fclose(out);
    char line[256];
    snprintf(line, sizeof line, "> %s\n", wanted);
    assert_string_equal(said, line);
    free(said);
}

static void text_is_left_as_it_is(void **state)
{
    (void)state;
    expect("", "");
    expect("a b~ 100 % \"x\" \\n", "a b~ 100 % \"x\" \\n");
    expect("\xc3\xa9 \xe8\x82\x9d \xf0\x9f\x98\x80 \xc2\xa0",
           "\xc3\xa9 \xe8\x82\x9d \xf0\x9f\x98\x80 \xc2\xa0");
}

static void commands_are_not(void **state)
{
    (void)state;
    expect("\033]0;pwned\007\033[2J", "?]0;pwned??[2J");
    expect("a\nwarning: b\r\tc\x7f", "a?warning: b? c?");
    expect("\xc2\x9b"
           "31m \x9b"
           "31m",
           "?31m ?31m"); /* C1, as UTF-8 and as a byte */
    expect("\xe2\x80\xae"
           "gnp.exe \xe2\x81\xa6x",
           "?gnp.exe ?x");
}

static void bytes_that_are_no_text_are_not(void **state)
{
    (void)state;
    expect("\xff\xfe"
           "a\xc3",
           "??a?");
    expect("\xc0\x9b[ \xe0\x82\x9b[ \xf0\x80\x80\x9b[", "??[ ???[ ????[");
    expect("\xed\xa0\x80 \xf4\x90\x80\x80 \xe8\x82", "??? ???? ??");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_is_left_as_it_is),
        cmocka_unit_test(commands_are_not),
        cmocka_unit_test(bytes_that_are_no_text_are_not),
    };
    return cmocka_run_group_tests_name("plain", tests, NULL, NULL);
}
