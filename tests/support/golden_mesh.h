/* golden_mesh.h -- a mesh of a golden file: an object with V and F.  Include after golden.h and
 * shapes.h. */
#ifndef APSM_TEST_GOLDEN_MESH_H
#define APSM_TEST_GOLDEN_MESH_H

static inline apsm_mesh golden_mesh(const json_t *c)
{
    json_t *V = golden_get(c, "V"), *F = golden_get(c, "F");
    apsm_mesh mesh = shape_alloc(json_array_size(V), json_array_size(F));
    golden_fill(V, mesh.V);
    double *f = golden_array(F, 3 * mesh.nf);
    for (size_t i = 0; i < 3 * mesh.nf; i++) mesh.F[i] = (uint32_t)f[i];
    free(f);
    return mesh;
}

#endif
