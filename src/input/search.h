/* search.h -- the shapes in a folder, and in the folders below it. */
#ifndef APSM_INPUT_SEARCH_H
#define APSM_INPUT_SEARCH_H

#include "input/input.h"

typedef struct search_hit {
    char *path;    /* folder/within */
    size_t within; /* where in path its part below the searched folder begins */
    apsm_input_kind kind;
} search_hit;

/* A folder of the file system, whatever links lead to it. */
typedef struct search_place {
    unsigned long long device, inode;
} search_place;

/* Owns its arrays and texts; zero-initialise with {0}. */
typedef struct search {
    search_hit *hit;
    size_t n, room;
    char **other; /* files that hold no shape, as far as is known */
    size_t others, others_room;
    size_t slices;    /* DICOM files beside shapes, of which they are none */
    size_t unmatched; /* shapes that the pattern does not mean */
    search_place *place;
    size_t places, places_room;
    size_t looked_at; /* entries of folders */
    size_t results;   /* folders of results that were passed over */
} search;

/* Adds the shapes in the folder: every file with the extension of one, and every folder that holds
 * DICOM files but no shapes.  With pattern (NULL or "": none), of all folders below those that it
 * means.  Without, if there are shapes in the folder itself, these; else those in all folders
 * below. Shapes below that are left out are named in a warning.
 *
 * Links are followed, each folder once; folders of models and fits of ours, hidden
 * ones and what operating systems leave behind (Thumbs.db, __MACOSX) are not searched, nor is what
 * lies more than 32 folders deep.  Where a model lies among its shapes, the files that its manifest
 * lists are none; if that does not say (the model is not finished), those it may fill are not
 * searched, with a warning.  The order does not depend on the file system.  */
apsm_status search_folder(apsm_context *ctx, const char *folder, const char *pattern, search *s);
/* Adds a folder that is known to be one case: its DICOM files. */
apsm_status search_series(apsm_context *ctx, const char *folder, search *s);
void search_free(search *s);
/* Whether it is a DICOM file: these have no agreed extension, but "DICM" after 128 bytes. */
bool search_is_dicom(const char *path);

#endif
