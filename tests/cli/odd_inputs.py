"""Odd files for test_inputs.sh, by plain struct: no reader or writer of ours.  odd_inputs.py FOLDER"""
import gzip, math, os, struct, sys

root = sys.argv[1]


def write(path, data):
    path = os.path.join(root, path)
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    with open(path, "wb") as f:
        f.write(data.encode() if isinstance(data, str) else data)


# ---- an egg as triangles, and as voxels ----
def egg(rows=12, around=20):
    V, F, quads = [(0, 0, 10)], [], []
    for i in range(1, rows):
        t = math.pi * i / rows
        for j in range(around):
            f = 2 * math.pi * j / around
            V.append((20 * math.sin(t) * math.cos(f), 14 * math.sin(t) * math.sin(f),
                      10 * math.cos(t) + 2 * math.sin(t) ** 4 * math.cos(f)))
    V.append((0, 0, -10))
    last = len(V) - 1
    for j in range(around):
        k = (j + 1) % around
        F += [(0, 1 + j, 1 + k), (last, last - around + k, last - around + j)]
    for i in range(rows - 2):
        for j in range(around):
            a, b = 1 + i * around + j, 1 + i * around + (j + 1) % around
            quads.append((a, a + around, b + around, b))
    return V, F, quads


V, CAPS, QUADS = egg()
F = CAPS + [t for a, c, d, b in QUADS for t in ((a, c, d), (a, d, b))]
N = (30, 26, 22)
M = [int(((x - 14) / 11) ** 2 + ((y - 12.5) / 8) ** 2 + ((z - 10.5) / 7) ** 2 < 1)
     for z in range(N[2]) for y in range(N[1]) for x in range(N[0])]


def nifti(data, kind=2, bits=8, dim=(3,) + N + (1, 1, 1, 1), spacing=(1, 1, 1), order="<"):
    h = struct.pack(order + "i", 348) + b"\0" * 36 + struct.pack(order + "8h", *dim) + b"\0" * 14
    h += struct.pack(order + "hhh", kind, bits, 0) + struct.pack(order + "8f", 1, *spacing, 1, 0, 0, 0)
    h += struct.pack(order + "fffh", 352, 0, 0, 0) + b"\0\2" + b"\0" * 24 + b"\0" * 104
    h += struct.pack(order + "hh", 1, 1) + b"\0" * 24
    for r in range(3):
        h += struct.pack(order + "4f", *[spacing[r] if c == r else 0 for c in range(4)])
    h += b"\0" * 16 + b"n+1\0"
    assert len(h) == 348
    return h + b"\0" * 4 + data


def floats(values):
    return struct.pack("<%df" % len(values), *values)


write("oneslice.nii", nifti(bytes(M[7800:8580]), dim=(3, 30, 26, 1, 1, 1, 1, 1)))
write("allzero.nii", nifti(bytes(len(M))))
write("onevoxel.nii", nifti(bytes(int(i == 8123) for i in range(len(M)))))
write("nan.nii", nifti(floats([1 if v else float("nan") for v in M]), 16, 32))
write("colours.nii", nifti(bytes(c for v in M for c in (255 * v, 0, 0)), 128, 24))
write("fourd.nii", nifti(bytes(M + M), dim=(4,) + N + (2, 1, 1, 1)))
write("probability.nii", nifti(floats([.9 * v + .03 for v in M]), 16, 32))
write("two.nii", nifti(bytes(2 if v and i % 30 > 14 else v for i, v in enumerate(M))))
write("scan.nii", nifti(struct.pack("<%dh" % len(M), *[300 * v - 1000 * (1 - v) + i % 3 for i, v in enumerate(M)]), 4, 16))
no_sform = nifti(bytes(M), spacing=(-2, 2, 2))
write("negative_size.nii", no_sform[:254] + b"\0\0" + no_sform[256:])
write("half_spacing.nrrd", b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 30 26 22\nspacings: 1 nan 1\nencoding: raw\n\n" + bytes(M))
write("no_endian.nrrd", b"NRRD0004\ntype: short\ndimension: 3\nsizes: 30 26 22\nspacings: 1 1 1\nencoding: raw\n\n"
      + struct.pack("<%dh" % len(M), *M))
write("no_syntax.dcm", bytes(128) + b"DICM" + bytes(100))
write("float.nii", nifti(floats(M), 16, 32))
write("big.nii", nifti(struct.pack(">%dh" % len(M), *M), 4, 16, order=">"))
write("gzip.nii", gzip.compress(nifti(bytes(M))))
write("plain.nii.gz", nifti(bytes(M)))
write("negative.nii", nifti(struct.pack("<%dh" % len(M), *[-v for v in M]), 4, 16))
write("bz2.nrrd", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 30 26 22\nspacings: 1 1 1\nencoding: bzip2\n\nBZh9")
write("absent.mhd", "NDims = 3\nDimSize = 30 26 22\nElementType = MET_UCHAR\nElementDataFile = nothere.raw\n")

write("slices/list.mhd", "NDims = 3\nDimSize = 30 26 22\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n"
      "ElementDataFile = LIST\n" + "".join("s%02d.raw\n" % k for k in range(22)))
for k in range(22):
    write("slices/s%02d.raw" % k, bytes(M[780 * k:780 * k + 780]))


# ---- meshes ----
def ply(V, F, order="ascii 1.0"):
    text = "ply\nformat %s\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n" % (order, len(V))
    text += "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(F)
    text += "".join("%.9g %.9g %.9g\n" % tuple(v) for v in V)
    return text + "".join("%d %s\n" % (len(f), " ".join(map(str, f))) for f in F)


def obj(V, F, point="v %g %g %g\n", base=1):
    return "".join(point % v for v in V) + "".join("f " + " ".join(str(i + base) for i in f) + "\n" for f in F)


def vtk(rest):
    points = "".join("%g %g %g\n" % v for v in V)
    return "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS %d float\n%s%s" % (len(V), points, rest)


def vtk51():
    offsets, corners = [0], []
    for f in CAPS + QUADS:
        corners += f
        offsets.append(len(corners))
    out = b"# vtk DataFile Version 5.1\nvtk output\nBINARY\nDATASET POLYDATA\nPOINTS %d float\n" % len(V)
    out += b"".join(struct.pack(">3f", *v) for v in V) + b"\nMETADATA\nINFORMATION 0\n\n"
    out += b"POLYGONS %d %d\nOFFSETS vtktypeint64\n" % (len(offsets), len(corners))
    out += struct.pack(">%dq" % len(offsets), *offsets) + b"\nCONNECTIVITY vtktypeint64\n"
    return out + struct.pack(">%dq" % len(corners), *corners) + b"\n"


def big_ply():
    head = "ply\nformat binary_big_endian 1.0\ncomment\nobj_info x\nelement camera 1\nproperty float f\n"
    head += "property list uint short q\nelement vertex %d\nproperty double x\nproperty uchar red\n" % len(V)
    head += "property double y\nproperty double z\nproperty list uchar float w\nelement face %d\n" % len(CAPS + QUADS)
    head += "property uchar flag\nproperty list uchar uint vertex_index\nproperty list uchar float texcoord\n"
    out = (head + "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n").encode()
    out += struct.pack(">fI2h", 1, 2, 3, 4)
    for x, y, z in V:
        out += struct.pack(">dBddB2f", x, 9, y, z, 2, 0, 0)
    for f in CAPS + QUADS:
        out += struct.pack(">BB%dIB3f" % len(f), 1, len(f), *f, 3, 0, 0, 0)
    return out + struct.pack(">2i", 0, 1)


def stl(head):
    out = head.ljust(80, b" ") + struct.pack("<I", len(F))
    for f in F:
        out += struct.pack("<12fH", 0, 0, 0, *V[f[0]], *V[f[1]], *V[f[2]], 0)
    return out


write("nan.ply", ply(V[:5] + [(float("nan"), 0, 0)] + V[6:], F))
write("far.ply", ply([(x + 1e7, y, z) for x, y, z in V], F))
write("points.vtk", vtk("VERTICES 1 2\n1 0\n"))
write("flat.ply", ply([(x, y, 0) for x, y, z in V], F))
write("giant.ply", ply([(1e200 * x, 1e200 * y, 1e200 * z) for x, y, z in V], F).replace("float", "double"))
write("halves.ply", ply(V + [(x + 60, y, z) for x, y, z in V], F + [tuple(i + len(V) for i in f) for f in F]))
write("comma.ply", ply(V, F).replace(".", ",").replace("ascii 1,0", "ascii 1.0"))
write("quads.ply", ply(V, CAPS + QUADS))
write("negative.obj", obj(V, F, base=-len(V)))
write("far_unused.obj", obj(V, F) + "v 1e30 0 0\n")
write("continued.obj", obj(V, F, "v %g %g \\\n %g\n"))
strips = "".join("42 " + " ".join("%d %d" % (1 + i * 20 + j % 20, 21 + i * 20 + j % 20) for j in range(21)) + "\n"
                 for i in range(10))
write("strips.vtk", vtk("POLYGONS 40 160\n" + "".join("3 %d %d %d\n" % f for f in CAPS) + "TRIANGLE_STRIPS 10 430\n" + strips))
write("version51.vtk", vtk51())
write("big.ply", big_ply())
write("solid.stl", stl(b"solid made by something"))
write("insideout.ply", ply(V, [f[::-1] for f in F]))

# ---- projects and names ----
write("empty.swproj", '{"data": []}')
write("nameless.swproj", '{"data": [{"name": "x"}]}')
write("old.xml", '<?xml version="1.0" ?>\n<number_of_particles> 32 </number_of_particles>\n<!-- two -->\n<inputs>\nquads.ply\n'
      "  big.ply\n</inputs>\n<fixed_domains> 1 </fixed_domains>\n")
write("points.xml", "<point_files>\na.particles\n</point_files>\n")
write("planes.xml", "<inputs> quads.ply </inputs>\n<cutting_planes> 0 0 0 1 0 0 0 1 0 </cutting_planes>\n")
write("torn.xml", "<inputs>\nquads.ply\n</input")
write("entity.xml", '<!DOCTYPE a [<!ENTITY b "c">]><inputs>&b;</inputs>')
write("newline/a\nb.ply", ply(V, F))
write("escape/\x1b[31mred.ply", ply(V, F))
write("caf\u00e9 o/a \u00fc\u0308.ply", ply(V, F))
