#ifdef APSM_HDF5
#include "exchange/hdf5_file.h"

#include <stdlib.h>
#include <string.h>

static hid_t with_groups(void)
{
    const hid_t list = H5Pcreate(H5P_LINK_CREATE);
    if (list >= 0) H5Pset_create_intermediate_group(list, 1);
    return list;
}

static hid_t without_times(void)
{
    const hid_t list = H5Pcreate(H5P_DATASET_CREATE);
    if (list >= 0) H5Pset_obj_track_times(list, false);
    return list;
}

/* Takes space and the types' names; columns 0: one axis. */
static bool put(hid_t file, const char *path, hid_t stored, hid_t given, hid_t space, const void *x)
{
    const hid_t link = with_groups(), create = without_times();
    const hid_t set = H5Dcreate2(file, path, stored, space, link, create, H5P_DEFAULT);
    bool good = set >= 0 && H5Dwrite(set, given, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) >= 0;
    if (set >= 0 && H5Dclose(set) < 0) good = false;
    H5Pclose(create);
    H5Pclose(link);
    H5Sclose(space);
    return good;
}

static hid_t space_of(size_t rows, size_t columns)
{
    const hsize_t size[2] = { rows, columns };
    return H5Screate_simple(columns ? 2 : 1, size, NULL);
}

bool h5_put_floats(hid_t file, const char *path, size_t rows, size_t columns, const float *x)
{
    return put(file, path, H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, space_of(rows, columns), x);
}

bool h5_put_ints(hid_t file, const char *path, size_t rows, size_t columns, const int *x)
{
    return put(file, path, H5T_STD_I32LE, H5T_NATIVE_INT, space_of(rows, columns), x);
}

bool h5_put_int(hid_t file, const char *path, int x)
{
    return put(file, path, H5T_STD_I32LE, H5T_NATIVE_INT, H5Screate(H5S_SCALAR), &x);
}

static hid_t text_type(const char *text)
{
    const hid_t type = H5Tcopy(H5T_C_S1);
    if (type >= 0) H5Tset_size(type, strlen(text) + 1);
    return type;
}

bool h5_put_text(hid_t file, const char *path, const char *text)
{
    const hid_t type = text_type(text);
    const bool good = type >= 0 && put(file, path, type, type, H5Screate(H5S_SCALAR), text);
    H5Tclose(type);
    return good;
}

bool h5_put_group(hid_t file, const char *path)
{
    const hid_t link = with_groups();
    const hid_t group = H5Gcreate2(file, path, link, H5P_DEFAULT, H5P_DEFAULT);
    H5Pclose(link);
    return group >= 0 && H5Gclose(group) >= 0;
}

bool h5_put_attribute(hid_t file, const char *group, const char *name, const char *text)
{
    const hid_t type = text_type(text), space = H5Screate(H5S_SCALAR);
    const hid_t attribute =
        H5Acreate_by_name(file, group, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    bool good = attribute >= 0 && H5Awrite(attribute, type, text) >= 0;
    if (attribute >= 0 && H5Aclose(attribute) < 0) good = false;
    H5Sclose(space);
    H5Tclose(type);
    return good;
}

/* Largest dataset, in numbers: 16 GB. */
static const hsize_t most_numbers = (hsize_t)1 << 31;

static bool get_size(hid_t set, hsize_t size[2])
{
    const hid_t space = H5Dget_space(set);
    const int axes = space < 0 ? -1 : H5Sget_simple_extent_ndims(space);
    size[0] = size[1] = 1;
    const bool good = axes >= 0 && axes <= 2 && H5Sget_simple_extent_dims(space, size, NULL) >= 0 &&
                      size[0] > 0 && size[1] > 0 && size[0] <= most_numbers / size[1];
    H5Sclose(space);
    return good;
}

bool h5_get(hid_t file, const char *path, size_t *rows, size_t *columns, double **x)
{
    hsize_t size[2];
    *x = NULL;
    const hid_t set = H5Dopen2(file, path, H5P_DEFAULT);
    if (set < 0) return false;
    bool good = get_size(set, size);
    if (good) *x = malloc((size_t)(size[0] * size[1]) * sizeof **x);
    good = good && *x && H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, *x) >= 0;
    H5Dclose(set);
    *rows = good ? (size_t)size[0] : 0;
    *columns = good ? (size_t)size[1] : 0;
    return good;
}
#else
typedef int hdf5_is_not_in_this_build; /* a C file holds something */
#endif
