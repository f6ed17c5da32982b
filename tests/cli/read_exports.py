"""Reads what test_export.sh has exported with readers that are not ours, and compares all with
model.json: read_exports.py FOLDER.  Needs NumPy; h5py where there is an HDF5 file."""

import base64
import csv
import json
import struct
import sys
import xml.etree.ElementTree as xml
import zlib
from pathlib import Path

import numpy as np

folder = Path(sys.argv[1])
model = json.loads((folder / "model/model.json").read_text())
mean, modes = np.array(model["mean"]), np.array(model["modes"])
variances = np.array(model["variances"])
failures = 0


def check(good, what):
    global failures
    if not good:
        print("FAILED:", what)
        failures += 1


def near(a, b, what, tolerance=1e-9):
    a, b = np.asarray(a, float), np.asarray(b, float)
    check(a.shape == b.shape, f"{what}: {a.shape}, not {b.shape}")
    if a.shape == b.shape:
        check(np.abs(a - b).max() <= tolerance * max(1, np.abs(b).max()),
              f"{what}: off by {np.abs(a - b).max()}")


# npz, by NumPy: the arrays that all others are compared with.
npz = np.load(folder / "model.npz")
near(npz["particle_mean"], mean, "npz particle_mean", 0)
near(npz["particle_modes"].ravel(), modes.ravel(), "npz particle_modes", 0)
near(npz["variances"], variances, "npz variances", 0)
rebuilt = npz["particle_mean"] + np.einsum("ik,kjc->ijc", npz["scores"], npz["particle_modes"])
near(rebuilt, npz["particles"], "npz: mean + scores x modes are the particles")
V, F, D = npz["mean"], npz["faces"], npz["modes"]
with open(folder / "model/scores.csv") as file:
    names = [row["name"] for row in csv.DictReader(file)]
check([n.decode() for n in npz["names"]] == names, "npz names")


# ply: the warp is linear, so a mode to the plus and the minus side lie about the mean.
def read_ply(path):
    data = path.read_bytes()
    head, _, body = data.partition(b"end_header\n")
    lines = head.decode().splitlines()
    n = int([x for x in lines if x.startswith("element vertex")][0].split()[2])
    fields = [x.split()[2] for x in lines if x.startswith("property float")]
    table = np.frombuffer(body, "<f4", n * len(fields)).reshape(n, -1)
    return dict(zip(fields, table.T.astype(float)))


def xyz(table):
    return np.stack([table["x"], table["y"], table["z"]], 1)


plain = read_ply(folder / "ply/mean.ply")
near(xyz(plain), V, "ply mean", 1e-6)
near(xyz(read_ply(folder / "ply/modes/mode_01_plus3sd.ply")), V + 3 * D[0], "ply mode 1", 1e-6)
near(xyz(read_ply(folder / "ply/modes/mode_01_minus1sd.ply")), V - D[0], "ply mode 1 minus", 1e-6)
check("surface_distance" in read_ply(folder / f"ply/shapes/{names[0]}.ply"), "ply field of shapes")


# vtp: VTK's XML, as its documentation defines it.
def read_vtp(path):
    arrays = {}
    for array in xml.parse(path).iter("DataArray"):
        text = array.text.strip()
        blocks = struct.unpack("<Q", base64.b64decode(text[:12])[:8])[0]
        size = (8 * (3 + blocks) + 2) // 3 * 4
        sizes = struct.unpack(f"<{3 + blocks}Q", base64.b64decode(text[:size]))[3:]
        packed, raw, at = base64.b64decode(text[size:]), b"", 0
        for n in sizes:
            raw += zlib.decompress(packed[at:at + n])
            at += n
        kind = {"Float64": "<f8", "Int64": "<i8"}[array.get("type")]
        arrays[array.get("Name")] = np.frombuffer(raw, kind)
    return arrays


vtp = read_vtp(folder / "vtp/mean.vtp")
near(vtp["Points"].reshape(-1, 3), V, "vtp mean", 0)
near(vtp["connectivity"].reshape(-1, 3), F, "vtp faces", 0)
check(len(vtp["sd_along_normal"]) == len(V) and vtp["sd_along_normal"].min() >= 0, "vtp field")
near(read_vtp(folder / "vtp/modes/mode_01_plus2sd.vtp")["Points"].reshape(-1, 3), V + 2 * D[0],
     "vtp mode 1", 1e-12)

# scene.mrml: every node that is pointed to is there, and every file.
scene = xml.parse(folder / "vtp/scene.mrml").getroot()
ids = {node.get("id") for node in scene}
models = scene.findall("Model")
check(all(m.get("displayNodeRef") in ids and m.get("storageNodeRef") in ids for m in models), "scene's nodes")
check(all((folder / "vtp" / s.get("fileName")).is_file() for s in scene.findall("ModelStorage")), "scene's files")
check({m.get("name") for m in models} >= {"mean", "mode_01_minus2sd", *names}, "scene's names")
check([d.get("visibility") for d in scene.findall("ModelDisplay")].count("true") == 1, "only the mean is shown")

# stl and obj.
stl = (folder / "stl/mean.stl").read_bytes()
faces = np.frombuffer(stl[84:], np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]))
near(faces["v"], V[F], "stl mean", 1e-6)
obj = (folder / "obj/mean.obj").read_text().split("\n")
near([x.split()[1:] for x in obj if x.startswith("v ")], V, "obj mean")

# gltf: header, chunks, accessors as Khronos defines them.
glb = (folder / "model.glb").read_bytes()
magic, version, length, json_length, kind = struct.unpack("<5I", glb[:20])
check((magic, version, length, kind) == (0x46546C67, 2, len(glb), 0x4E4F534A), "glb header")
gltf = json.loads(glb[20:20 + json_length])
binary = glb[28 + json_length:]
check(gltf["buffers"][0]["byteLength"] == len(binary), "glb length")


def accessor(k):
    a = gltf["accessors"][k]
    view = gltf["bufferViews"][a["bufferView"]]
    kind = {5126: "<f4", 5125: "<u4"}[a["componentType"]]
    x = np.frombuffer(binary[view["byteOffset"]:view["byteOffset"] + view["byteLength"]], kind)
    x = x.reshape(-1, 3) if a["type"] == "VEC3" else x
    check(len(x) == a["count"], "glb count")
    if "min" in a:
        near(x.min(0), a["min"], "glb min", 0)
        near(x.max(0), a["max"], "glb max", 0)
    return x


primitive = gltf["meshes"][0]["primitives"][0]
near(accessor(primitive["attributes"]["POSITION"]), V, "glb mean", 1e-6)
near(accessor(primitive["indices"]).reshape(-1, 3), F, "glb faces", 0)
for k, target in enumerate(primitive["targets"]):
    near(accessor(target["POSITION"]), D[k], f"glb target {k}", 1e-6)

# monai: an orthonormal basis of the same distribution.
monai = json.loads((folder / "monai/pca_model.json").read_text())
components, eigenvalues = np.array(monai["components"]), np.array(monai["eigenvalues"])
near(components @ components.T, np.eye(len(components)), "monai basis")
flat = D.reshape(len(D), -1)
near((components.T * eigenvalues) @ components, flat.T @ flat, "monai covariance")
check(abs(sum(monai["explained_variance_ratio"]) - 1) < 1e-9, "monai shares")
near(read_vtp(folder / "monai/pca_mean_surface.vtp")["Points"].reshape(-1, 3), V, "monai mean")


# slicermorph and csv.
def table(path):
    with open(folder / path) as file:
        return list(csv.reader(file))


rows = table("slicermorph/outputData.csv")
near(np.array([r[3:] for r in rows[1:]], float).reshape(npz["particles"].shape), npz["particles"],
     "slicermorph coordinates", 1e-12)
log = json.loads((folder / "slicermorph/analysis.json").read_text())["GPALog"][0]
for key in ("MeanShape", "Eigenvalues", "Eigenvectors", "OutputData", "PCScores"):
    check((folder / "slicermorph" / log[key]).is_file(), f"slicermorph {key}")
vectors = np.array([r[1:] for r in table("slicermorph/eigenvector.csv")[1:]], float)
scores = np.array([r[1:] for r in table("slicermorph/pcScores.csv")[1:]], float)
near(mean.ravel() + scores @ vectors.T, npz["particles"].reshape(len(names), -1),
     "slicermorph: mean + scores x vectors")
near(np.array(table("csv/modes.csv")[1:], float).reshape(len(V), -1, 3).transpose(1, 0, 2), D,
     "csv modes", 1e-12)
near(np.array(table("csv/mean.csv")[1:], float), V, "csv mean", 1e-12)

# VTK's own readers, for what the lines above read by themselves.
try:
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
except ImportError:
    print("NOT TESTED: vtp, ply, stl and obj read by VTK; it is not installed (python3-vtk9)")
else:
    def by_vtk(reader, name):
        reader.SetFileName(str(folder / name))
        reader.Update()
        return reader.GetOutput()

    def triangles(data):
        return vtk_to_numpy(data.GetPolys().GetData()).reshape(-1, 4)[:, 1:]

    for path, want in (("vtp/mean.vtp", V), ("vtp/modes/mode_01_plus2sd.vtp", V + 2 * D[0]), ("monai/pca_mean_surface.vtp", V)):
        data = by_vtk(vtk.vtkXMLPolyDataReader(), path)
        near(vtk_to_numpy(data.GetPoints().GetData()), want, f"VTK {path}", 1e-9)
        near(triangles(data), F, f"VTK faces of {path}", 0)
    along = vtk_to_numpy(by_vtk(vtk.vtkXMLPolyDataReader(), "vtp/mean.vtp").GetPointData().GetArray("sd_along_normal"))
    near(along, vtp["sd_along_normal"], "VTK field", 0)
    for path, reader in (("ply/mean.ply", vtk.vtkPLYReader()), ("obj/mean.obj", vtk.vtkOBJReader())):
        data = by_vtk(reader, path)
        near(vtk_to_numpy(data.GetPoints().GetData()), V, f"VTK {path}", 1e-6)
        near(triangles(data), F, f"VTK faces of {path}", 0)
    data = by_vtk(vtk.vtkSTLReader(), "stl/mean.stl")  # corners that are one become one
    near(vtk_to_numpy(data.GetPoints().GetData())[triangles(data)], V[F], "VTK stl", 1e-6)
    print(f"read by VTK {vtk.vtkVersion.GetVTKVersion()}: vtp, ply, obj, stl")

if (folder / "model.h5").exists():
    try:
        import h5py
    except ImportError:
        print("NOT TESTED: scalismo read by h5py; it is not installed (python3-h5py)")
    else:
        h5 = h5py.File(folder / "model.h5")
        check(h5["representer"].attrs["datasetType"] == b"POLYGON_MESH", "h5 type")
        check(h5["version/minorVersion"][()] == 9, "h5 version")
        near(h5["representer/points"][:].T, V, "h5 points", 1e-6)
        near(h5["representer/cells"][:].T, F, "h5 cells", 0)
        near(h5["model/mean"][:], V.ravel(), "h5 mean", 1e-6)
        basis, values = h5["model/pcaBasis"][:], h5["model/pcaVariance"][:]
        near((basis * values) @ basis.T, flat.T @ flat, "h5 covariance", 1e-5)
        near(basis.T @ basis, np.eye(len(values)), "h5: the basis is orthonormal", 1e-5)
        # As Scalismo makes an instance: mean + basis x (sqrt(variance) x coefficients).  Those of a shape are its scores.
        scores = h5["modelinfo/scores"][:]
        check(scores.shape == (len(values), len(names)), "h5 scores")
        instances = h5["model/mean"][:] + (basis * np.sqrt(values)) @ scores[:, :1].ravel() if len(values) else 0
        shape = read_ply(folder / f"ply/shapes/{names[0]}.ply")
        near(instances.reshape(-1, 3), xyz(shape), "h5: an instance by a shape's scores is the shape", 1e-5)
        check(h5["representer"].attrs["name"] in (b"itkStandardMeshRepresenter", "itkStandardMeshRepresenter"), "h5 representer")
        check(h5["catalog/apsm/modelPath"][()] in (b"/", "/"), "h5 catalog")
        print(f"read by h5py {h5py.__version__}: scalismo, statismo")
sys.exit(1 if failures else 0)
