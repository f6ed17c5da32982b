# %% [markdown]
# # From bones to an answer, in Python
# Cells as in a notebook (VS Code, Spyder and Jupytext open this file as one); as a program:
#
#     python examples/cohort.py data/talus 128
#
# needs the module `apsm` alone (python/README.md). With NumPy, results are its arrays; with pandas, tables are its frames.

# %%
import os
import sys
import tempfile

import apsm

given = [word for word in sys.argv[1:] if not word.startswith("-")]  # a notebook has words of its own
shapes = given[0] if given else "data/talus"
particles = int(given[1]) if len(given) > 1 else 128
out = tempfile.mkdtemp(prefix="apsm-")
model_folder = os.path.join(out, "model")

# %% [markdown]
# ## The model
# What `apsm run` does, into a folder that all other steps read. Left bones are mirrored; the last bone is kept aside, as a
# patient who comes later.

# %%
files = sorted(os.path.join(shapes, f) for f in os.listdir(shapes) if f.endswith(".ply"))
patient = files.pop()
apsm.run_files(files, model_folder, particles=particles, reflect_match="_L_", log=print)
model = apsm.load(model_folder)

# %% [markdown]
# ## A table of subjects, and a question
# Here the side, and a number that means nothing. Any table will do that names the shapes in its first column.

# %%
table = os.path.join(out, "subjects.csv")
with open(table, "w", encoding="utf-8") as file:
    print("name,side,luck", file=file)
    for k, path in enumerate(files):
        name = os.path.splitext(os.path.basename(path))[0]
        print(f"{name},{'left' if '_L_' in name else 'right'},{k * 7 % 11}", file=file)

found = apsm.test(model_folder, "~ side + luck", subjects=table, permutations=2000, bootstraps=200, log=print)
print(f"{found['of']} on {found['on']}: p = {found['p']:.3g}, {100 * found['share_of_variance']:.1f} % of the variance")
at = min(range(len(found["p_familywise"])), key=found["p_familywise"].__getitem__)
effect = found["effects"][0]
print(f"{effect['name']}: largest at particle {at}, {effect['along_normal'][at]:.3g} outward "
      f"(95 %: {effect['low'][at]:.3g} to {effect['high'][at]:.3g}), family-wise p = {found['p_familywise'][at]:.3g}")

# %% [markdown]
# ## The patient
# Meshes of trimesh and PyVista are taken as they are; here the file is read by a few lines.


# %%
def read_ply(path):
    """Vertices and triangles of a binary PLY of floats, as apsm writes it."""
    import struct

    with open(path, "rb") as file:
        nv = nf = 0
        for line in iter(file.readline, b"end_header\n"):
            words = line.split()
            if words[:2] == [b"element", b"vertex"]:
                nv = int(words[2])
            if words[:2] == [b"element", b"face"]:
                nf = int(words[2])
        vertices = list(struct.iter_unpack("<3f", file.read(12 * nv)))
        faces = [face[1:] for face in struct.iter_unpack("<B3i", file.read(13 * nf))]
    return vertices, faces


fit = model.fit(*read_ply(patient), name="patient", force=True)
print(fit, f"mean distance of the surfaces {fit.surface_mean:.3g}; mirrored: {fit.mirrored}")

# %% [markdown]
# ## For other programs

# %%
apsm.export(model_folder, "csv", os.path.join(out, "tables"), log=print)
print("model, report and tables are in", out)
