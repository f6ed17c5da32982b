/* Pictures: the PNG holds the pixels, words leave ink where they should and nowhere else. */
#include "cmocka_all.h"

#include <png.h>
#include <stdlib.h>
#include <string.h>

#include "folder.h"
#include "report/picture.h"

static picture make(apsm_context *ctx, size_t width, size_t height)
{
    picture p;
    assert_int_equal(picture_make(ctx, width, height, &p), APSM_OK);
    return p;
}

static void test_png_holds_the_pixels(void **state)
{
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    picture p = make(ctx, 37, 23);
    for (size_t k = 0; k < 3 * 37 * 23; k++) p.rgb[k] = (unsigned char)(k * 131 % 256);
    assert_int_equal(picture_write(ctx, &p, folder_path(state, "a.png", path)), APSM_OK);
    png_image image = { .version = PNG_IMAGE_VERSION };
    assert_true(png_image_begin_read_from_file(&image, path));
    assert_int_equal(image.width, 37);
    assert_int_equal(image.height, 23);
    image.format = PNG_FORMAT_RGB;
    unsigned char back[3 * 37 * 23];
    assert_true(png_image_finish_read(&image, NULL, back, 0, NULL));
    assert_memory_equal(back, p.rgb, sizeof back);
    assert_int_equal(folder_count(*state), 1);
    picture_free(&p);
    apsm_context_free(ctx);
}

static void test_no_place_to_write(void **state)
{
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    picture p = make(ctx, 3, 3);
    assert_int_equal(picture_write(ctx, &p, folder_path(state, "none/a.png", path)), APSM_ERR_IO);
    assert_non_null(strstr(apsm_error_text(ctx), "none/a.png"));
    picture_free(&p);
    apsm_context_free(ctx);
}

typedef struct extent {
    size_t left, right, top, bottom, ink;
} extent;

static extent ink_of(const picture *p)
{
    extent e = { p->width, 0, p->height, 0, 0 };
    for (size_t y = 0; y < p->height; y++)
        for (size_t x = 0; x < p->width; x++) {
            if (p->rgb[3 * (y * p->width + x)] > 127) continue;
            e.left = x < e.left ? x : e.left;
            e.right = x > e.right ? x : e.right;
            e.top = y < e.top ? y : e.top;
            e.bottom = y > e.bottom ? y : e.bottom;
            e.ink++;
        }
    return e;
}

static extent write_words(picture_align align, size_t x, size_t widest, const char *text)
{
    apsm_context *ctx = apsm_context_new();
    picture p = make(ctx, 300, 60);
    const picture_style style = { .pixels = 16, .align = align };
    assert_int_equal(picture_text(ctx, &p, x, 20, widest, &style, text), APSM_OK);
    const extent e = ink_of(&p);
    picture_free(&p);
    apsm_context_free(ctx);
    return e;
}

static void test_words_lie_where_they_should(void **state)
{
    (void)state;
    const extent left = write_words(PICTURE_LEFT, 150, 300, "talus"),
                 centre = write_words(PICTURE_CENTRE, 150, 300, "talus"),
                 right = write_words(PICTURE_RIGHT, 150, 300, "talus");
    const size_t width = left.right - left.left + 1;
    assert_in_range(width, 30, 60);
    assert_in_range(left.left, 149, 154);
    assert_in_range(right.right, 145, 150);
    assert_in_range((centre.left + centre.right) / 2, 147, 153);
    assert_true(left.top >= 20 && left.bottom < 40);
    assert_int_equal(left.ink, right.ink);
    assert_int_equal(write_words(PICTURE_LEFT, 150, 300, "").ink, 0);
}

/* Too wide: the end is kept, since the ends of names tell them apart. */
static void test_wide_words_are_shortened(void **state)
{
    (void)state;
    const char *name = "a_very_long_name_of_a_shape_\xc3\xa9t\xc3\xa9_017";
    const extent whole = write_words(PICTURE_LEFT, 0, 300, name),
                 part = write_words(PICTURE_LEFT, 0, 80, name),
                 other = write_words(PICTURE_LEFT, 0, 80, "b_very_long_name_of_a_shape_x_018");
    assert_true(whole.right > 200 && part.right < 80 && part.right > 50);
    assert_int_not_equal(part.ink, other.ink);
}

static void test_words_are_cut_at_the_edge(void **state)
{
    (void)state;
    assert_true(write_words(PICTURE_LEFT, 290, 300, "WWWW").right == 299);
    const extent cut = write_words(PICTURE_RIGHT, 5, 300, "WWWW");
    assert_true(cut.left == 0 && cut.right < 10);
    assert_int_equal(write_words(PICTURE_LEFT, 5000, 300, "WWWW").ink, 0);
}

int main(void)
{
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        IN_FOLDER(test_png_holds_the_pixels),
        IN_FOLDER(test_no_place_to_write),
        cmocka_unit_test(test_words_lie_where_they_should),
        cmocka_unit_test(test_wide_words_are_shortened),
        cmocka_unit_test(test_words_are_cut_at_the_edge),
    };
    return cmocka_run_group_tests_name("picture", tests, NULL, NULL);
}
