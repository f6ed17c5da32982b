/* measurement.h -- what is measured: defined once on the template, evaluated on its mesh as it is
 * carried to any shape. */
#ifndef APSM_STATISTICS_MEASUREMENT_H
#define APSM_STATISTICS_MEASUREMENT_H

#include <stdbool.h>

#include "apsm/mesh.h"
#include "folder/model_folder.h"

/* X(enum, word in files, points at least, at most, unit: power of a length, 0 for degrees) */
#define MEASURE_KINDS(X)                                                                           \
    X(DISTANCE, "distance", 2, 2, 1)                                                               \
    X(ANGLE, "angle", 3, 4, 0)                                                                     \
    X(PLANE_DISTANCE, "plane-distance", 4, 99, 1)                                                  \
    X(SPHERE, "sphere", 1, 99, 1)                                                                  \
    X(CYLINDER, "cylinder", 1, 99, 1)                                                              \
    X(SECTION, "section", 3, 99, 2)                                                                \
    X(THICKNESS, "thickness", 1, 1, 1)                                                             \
    X(AREA, "area", 0, 0, 2)                                                                       \
    X(VOLUME, "volume", 0, 0, 3)
#define MEASURE_ENUM(name, word, least, most, power) MEASURE_##name,
typedef enum measure_kind { MEASURE_KINDS(MEASURE_ENUM) MEASURE_KIND_COUNT } measure_kind;

typedef struct measurement {
    char *name;
    measure_kind kind;
    size_t points, first_point; /* among all points of the list */
    size_t part;                /* faces of this part only; SIZE_MAX: of all */
    double radius;              /* of the region around the points; 0: the points alone */
    bool whole;                 /* of a section: all that the plane cuts, not one curve */
    size_t vertices;            /* of the region */
    uint32_t *vertex;
    apsm_surface_point on; /* where thickness begins */
} measurement;

/* Owns everything; zero-initialise with {0}, measurement_list_free leaves it so. */
typedef struct measurement_list {
    size_t n, points;
    measurement *of;
    double *point; /* points x 3: on the template, in the world frame of the model */
} measurement_list;

/* Reads a definition (docs/formats.md).  Refused with file and name: an unknown kind or key (the
 * nearest is named), a name twice, too few or too many points, a particle that is none. */
apsm_status measurement_list_read(apsm_context *ctx, const char *path, const model_folder *m,
                                  measurement_list *list) APSM_NODISCARD;
void measurement_list_free(measurement_list *list);
const char *measure_word(measure_kind kind);
int measure_power(measure_kind kind);

/* The template's mesh and the points of the list, carried to a shape. */
typedef struct carried_shape {
    apsm_mesh mesh;
    double *VN;    /* nv x 3: normals of the vertices */
    double *point; /* of the list */
    double *work;  /* nv x 6, and 3 more a point */
    size_t parts;
    const size_t *first_face; /* parts + 1 */
} carried_shape;

/* NAN where a measurement is not defined on a shape: the plane cuts nothing, a fit fails. */
apsm_status measurement_value(const measurement *one, const carried_shape *s,
                              double *value) APSM_NODISCARD;

#endif
