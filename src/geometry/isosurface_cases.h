/* isosurface_cases.h -- how a surface cuts a cell of a grid, for each of the 256 ways in which its
 * corners lie inside or outside.
 *
 * Corner x + 2 y + 4 z of the cell is bit x + 2 y + 4 z of the case, set if inside.  Edge 4 a + u +
 * 2 v runs along axis a; u and v are its place along the other two axes, in their order.  A case
 * is a text of three letters for each triangle, 'a' for edge 0; triangles face outward.
 *
 * Made from these rules: on each face of the cell crossings are joined in pairs, round each outside
 * corner by itself where both diagonals are possible, so that neighbours agree; the pairs make
 * loops; a loop is cut into triangles without a diagonal in a face of the cell (it might be another
 * triangle's), as evenly as it goes.  So every surface is a closed manifold, up to the border of
 * the grid. */
#ifndef APSM_GEOMETRY_ISOSURFACE_CASES_H
#define APSM_GEOMETRY_ISOSURFACE_CASES_H

static const char isosurface_case[256][16] = {
    "", "aei", "ajf", "eifijf", "bke", "abibki", "ajejfkfbkjke", "bkibifijf", "bfl",
    "afiflilbibei", "ajbjlb", "bejeijbjl", "efkflk", "afkflkaki", "ajlalelke", "ijkjlk", "cig",
    "aecegc", "aifigfgcfcjf", "cjejfeceg", "bkckgcbcecie", "abkakgagc", "aiebkfkgfgcfcjf",
    "bkfkgfgcfcjf", "bflcig", "afcflclbgbeglgc", "aibigbgclcjlglb", "begbglgclcjl",
    "cifiefcflclglkg", "afcflclkglgc", "aiecjlclglkg", "cjlclglkg", "chj", "aejeihichehj",
    "acfchf", "chfcfifei", "bkechj", "abjbkhkickchbhj", "acechkhfbhbkcke", "bkibificfchf",
    "bfcfjcbclchl", "afjbeleiliclchl", "achahlalb", "beleiliclchl", "chkhlkckecejefj",
    "afjchkhlkcki", "acechkhlkcke", "chkhlkcki", "ghihji", "aegagjghj", "aihighahf", "egfghf",
    "bkhkghbhjbjejie", "abjbkhkghbhj", "aiebkhkghbhf", "bkhkghbhf", "bfifjibigbglghl",
    "afjbegbglghl", "aibigbghlglb", "begbglghl", "efifjighkhlk", "afjghkhlk", "aieghkhlk",
    "ghkhlk", "dgk", "aedekdadidgi", "ajfdgk", "dgjgijdjfdfkfek", "bdedge", "abibdgbgi",
    "ajgjfdfbdjdgage", "bdfdgjgijdjf", "bfkflgldgfgk", "afiflildidgibek", "ajgjldjdgagkakb",
    "bekdgjgijdjl", "dgedelefl", "afiflildidgi", "ajlaleldedge", "dgjgijdjl", "cidikd",
    "aecekckdc", "aikakfkdfdcjdjf", "cjdjfdfekfkd", "bdedcidie", "abcbdc", "aiebdfdcjdjf",
    "bdfdcjdjf", "bfiflcldcfcibik", "afcflcldcbek", "aibikbcjdjld", "bekcjdjld", "cidiedefleld",
    "afcflcldc", "aiecjdjld", "cjdjld", "cgjgkjkdjdhj", "aejekjkdjdhjcgi", "acgagkakfkdfdhf",
    "cgidhfdfkfek", "bdhbhjbjejcecge", "abjbdhbhjcgi", "acecgebdfdhf", "bdfdhfcgi",
    "bfkfjkjckcgkdhl", "afjbekcgidhl", "acgagkakbdhl", "bekcgidhl", "cgecejefjdhl", "afjcgidhl",
    "acecgedhl", "cgidhl", "dhihjidik", "aejekjkdjdhj", "aikakfkdfdhf", "dhfdfkfek",
    "bdedhihjidie", "abjbdhbhj", "aiebdfdhf", "bdfdhf", "bfifjibikdhl", "afjbekdhl", "aibikbdhl",
    "bekdhl", "dhlefifji", "afjdhl", "aiedhl", "dhl", "dlh", "aeidlh", "ajdjhdadfdlf",
    "dlelfedeidihijh", "blelhehdedke", "ablalhahihdidki", "ajejhehdedkeblf", "blfdkidihijh",
    "bfdfhd", "afhahihdidbedei", "ajbjhbhdb", "bedeidijhihd", "dkfkefdfh", "afhahihdidki",
    "ajejhehdedke", "dkidihijh", "cihiglgdlilh", "aelegdedlalhahc", "aifigfgdfdlfcjh",
    "cjhdlelfedeg", "blelhehceciedkg", "ablalhahcdkg", "aieblfcjhdkg", "blfcjhdkg",
    "bfifhcfcibigbgd", "afcfhcbedegd", "aibigbgdbcjh", "bedegdcjh", "cifiefcfhdkg", "afcfhcdkg",
    "aiecjhdkg", "cjhdkg", "cdjdlj", "aeleidicdedlalj", "acfcdlclf", "cdidlelfedei",
    "bljbjejcecdkcke", "abjbljcdidki", "acecdkckeblf", "blfcdidki", "bfdfjdjcd", "afjbedeidicd",
    "acbcdb", "bedeidicd", "cdjdkfkefdfj", "afjcdidki", "acecdkcke", "cdidki", "dljdjgjig",
    "aegagjgdjdlj", "aifigfgdfdlf", "dlelfedeg", "bljbjejiedkg", "abjbljdkg", "aieblfdkg",
    "blfdkg", "bfdfjdjigjgd", "afjbedegd", "aibigbgdb", "bedegd", "dkgefifji", "afjdkg", "aiedkg",
    "dkg", "gkhklh", "aeleklalhahihgi", "ajgjhgagkakfklf", "ekfklfgihijh", "blglhgbge",
    "abiblglhgbgi", "ajgjhgageblf", "blfgihijh", "bfhbhkhgk", "afhahihgibek", "ajbjhbhgkhkb",
    "bekgihijh", "efgfhg", "afhahihgi", "ajgjhgage", "gihijh", "cikckhklh", "aecekcklhkhc",
    "aikakfklfcjh", "cjhekfklf", "blelhehcecie", "ablalhahc", "aieblfcjh", "blfcjh",
    "bfhbhkhckcik", "afcfhcbek", "aibikbcjh", "bekcjh", "cifiefcfh", "afcfhc", "aiecjh", "cjh",
    "cglgklclj", "aeleklaljcgi", "acfcglgklclf", "cgiekfklf", "bljbjejcecge", "abjbljcgi",
    "acecgeblf", "blfcgi", "bfkfjkjckcgk", "afjbekcgi", "acgagkakb", "bekcgi", "cgecejefj",
    "afjcgi", "acecge", "cgi", "ikjklj", "aeleklalj", "aikakfklf", "ekfklf", "bljbjejie",
    "abjblj", "aieblf", "blf", "bfifjibik", "afjbek", "aibikb", "bek", "efifji", "afj", "aie", ""
};

#endif
