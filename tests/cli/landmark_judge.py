"""What evaluation.json says of landmarks, computed anew.  Arguments: a model folder, the file of the landmarks
(shape,name,x,y,z in the frames of the inputs).  Standard library only."""
import csv
import json
import math
import sys

folder, path = sys.argv[1], sys.argv[2]
marks = {}
with open(path, encoding="utf-8") as f:
    for row in csv.DictReader(f):
        marks.setdefault(row["shape"], {})[row["name"]] = [float(row[c]) for c in "xyz"]
with open(folder + "/project.swproj", encoding="utf-8") as f:
    project = json.load(f)


def apply(text, x):
    m = list(map(float, text.split()))
    return [sum(m[4 * r + c] * v for c, v in enumerate(x + [1])) for r in range(3)]


def world(row, x):
    if row.get("reflection"):
        x = apply(row["reflection"], x)
    return apply(row["alignment_1"], x)


def particles(row):
    with open("%s/particles/%s_world.particles" % (folder, row["name"])) as f:
        return [list(map(float, line.split())) for line in f]


def solve(A, B):
    n = len(A)
    for k in range(n):
        p = max(range(k, n), key=lambda r: abs(A[r][k]))
        A[k], A[p], B[k], B[p] = A[p], A[k], B[p], B[k]
        for r in range(n):
            if r != k and A[r][k]:
                f = A[r][k] / A[k][k]
                A[r] = [a - f * b for a, b in zip(A[r], A[k])]
                B[r] = [a - f * b for a, b in zip(B[r], B[k])]
    return [[v / A[k][k] for v in B[k]] for k in range(n)]


rows = {r["name"]: r for r in project["data"]}
template = project["apsm"]["template_used"]
T = particles(rows[template])
n = len(T)
K = [[math.dist(a, b) for b in T] + [1] + a for a in T]
K += [[1] * n + [0] * 4] + [[a[c] for a in T] + [0] * 4 for c in range(3)]
with open(folder + "/evaluation.json", encoding="utf-8") as f:
    said = json.load(f)["landmarks"]
worst, every = 0, []
for shape in said["per_shape"]:
    name = shape["name"]
    own = marks.get(name, {})
    W = solve([r[:] for r in K], particles(rows[name]) + [[0, 0, 0]] * 4)
    for label, error in zip(said["names"], shape["errors"]):
        there = label in own and label in marks[template] and name != template
        if there != (error is not None):
            sys.exit("FAILED: %s of %s" % (label, name))
        if not there:
            continue
        at = world(rows[template], marks[template][label])
        phi = [math.dist(at, t) for t in T] + [1] + at
        y = [sum(p * w[c] for p, w in zip(phi, W)) for c in range(3)]
        every.append(math.dist(y, world(rows[name], own[label])))
        worst = max(worst, abs(every[-1] - error))
mean = sum(every) / len(every)
if worst > 1e-5 or abs(mean - said["mean"]) > 1e-6 or said["judged"] != len(every):
    sys.exit("FAILED: off by %g; mean %g, said %g" % (worst, mean, said["mean"]))
