/* SHA-256 against the examples published with FIPS 180-4 (and the million a's). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "files/files.h"
#include "folder.h"

static void digest(const char *text, size_t size, size_t step, char hex[65])
{
    unsigned char bytes[32];
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    for (size_t at = 0; at < size; at += step)
        apsm_sha256_add(&sha, text + at, size - at < step ? size - at : step);
    apsm_sha256_end(&sha, bytes);
    apsm_sha256_hex(bytes, hex);
}

static void published_examples_agree(void **state)
{
    (void)state;
    const struct {
        const char *text, *hex;
    } cases[] = {
        { "", "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855" },
        { "abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad" },
        { "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
          "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1" },
        { "abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqr"
          "lmnopqrsmnopqrstnopqrstu",
          "cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1" },
    };
    char hex[65];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (size_t step = 1; step <= 128; step++) {
            digest(cases[i].text, strlen(cases[i].text), step, hex);
            assert_string_equal(hex, cases[i].hex);
        }
}

static void a_text_ends_in_its_zero(void **state)
{
    (void)state;
    static const char texts[] = "ab\0c\0";
    unsigned char bytes[32];
    char hex[65], want[65];
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "ab");
    apsm_sha256_add_text(&sha, "c");
    apsm_sha256_add_text(&sha, "");
    apsm_sha256_end(&sha, bytes);
    apsm_sha256_hex(bytes, hex);
    digest(texts, sizeof texts, 1, want);
    assert_string_equal(hex, want);
}

static void a_file_of_a_million_letters_agrees(void **state)
{
    static char letters[1000000];
    char path[TEST_PATH], hex[65];
    memset(letters, 'a', sizeof letters);
    folder_put(state, "letters", letters, sizeof letters);
    assert_int_equal(apsm_sha256_file(NULL, folder_path(state, "letters", path), hex), APSM_OK);
    assert_string_equal(hex, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    assert_int_equal(apsm_sha256_file(NULL, folder_path(state, "none", path), hex), APSM_ERR_IO);
    assert_int_equal(apsm_sha256_file(NULL, *state, hex), APSM_ERR_IO);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(published_examples_agree),
        cmocka_unit_test(a_text_ends_in_its_zero),
        cmocka_unit_test_setup_teardown(a_file_of_a_million_letters_agrees, folder_set_up,
                                        folder_tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
