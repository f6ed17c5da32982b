"""Generated projects: groom writes a project that has lost nothing.  Arguments: the program, a folder
with in/p0/bone.ply ... in/p3/bone.ply, how many projects.  Standard library only."""
import json
import os
import random
import shutil
import subprocess
import sys

apsm, folder, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
OURS = ("groomed_", "local_particles_", "world_particles_", "alignment_", "procrustes_")
PATHS = ("landmarks_file_", "image_", "feature_", "shape_", "segmentation_", "mesh_")
WORDS = ["", "a", "yes", "41.5", "-3", "é", "two words", "<b>&\"'", "x" * 70]


def value(rng):
    return rng.choice(WORDS + [True, 7, 2.5])


def text(v):
    if isinstance(v, bool):
        return "true" if v else "false"
    return v if isinstance(v, str) else repr(v)


def project(rng):
    domain = rng.choice(["1", "femur", "2"])
    kind = rng.choice(["shape_", "mesh_", "segmentation_"])
    columns = ["group_" + c for c in "abc"] + ["notes", "image_ct", "feature_w", "other", "", "apsm_x"]
    columns = rng.sample(columns, rng.randint(0, len(columns))) + ["landmarks_file_" + domain]
    rows = []
    for i in rng.sample(range(4), rng.randint(3, 4)):
        row = {"name": rng.choice(["n", "é ", "s.", "A-"]) + str(i)}
        row[kind + domain] = "in/p%d/bone.ply" % i
        row.update({c: value(rng) for c in columns if rng.random() < 0.8})
        if rng.random() < 0.3:
            row["mirrored"] = "yes"
        if rng.random() < 0.3:
            row["alignment_" + domain] = "1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1"
        rows.append(row)
    if len(rows) == 4 and rng.random() < 0.5:
        rows[rng.randrange(4)]["excluded"] = rng.choice(["yes", "TRUE", True, "1"])
    root = {"data": rows}
    for g in rng.sample(["groom", "studio", "analysis", "deepssm", "landmarks", "mine"], 3):
        root[g] = rng.choice([{"k": "v", "1": {"x": "y"}}, [], {}, {"e": "é"}])
    if rng.random() < 0.5:
        root["optimize"] = {"relative_weighting": "3", "number_of_particles": "64"}
    return domain, kind, root


def same(key, before, after):
    before = text(before)
    if not key.startswith(PATHS) or before == "":
        return before == after
    if before.startswith("/"):
        return before == after
    return os.path.normpath(os.path.join(folder, before)) == os.path.normpath(
        os.path.join(folder, "any", "m", after))


def excluded(row):
    return text(row.get("excluded", "no")).lower() in ("yes", "true", "1")


def lost(domain, kind, before, after):
    rows = {r["name"]: r for r in after["data"]}
    if len(rows) != len(before["data"]):
        return "rows %s" % sorted(rows)
    for row in before["data"]:
        now = rows.get(row["name"])
        if now is None:
            return "shape %s" % row["name"]
        for key, v in row.items():
            if key in ("mirrored", "reflection") or key.startswith(OURS):
                continue
            if key not in now or not same(key, v, now[key]):
                return "%s of %s: %r, now %r" % (key, row["name"], v, now.get(key))
        if not excluded(row):
            if now["groomed_" + domain] != "groomed/%s.ply" % row["name"] or now.get("mirrored") == "yes":
                return "groomed mesh of %s" % row["name"]
    for group, v in before.items():
        if group != "data" and after.get(group) != v:
            return "group %s: %r, now %r" % (group, v, after.get(group))
    return None


failed = 0
for seed in range(count):
    rng = random.Random(seed)
    domain, kind, root = project(rng)
    path, model = os.path.join(folder, "any.swproj"), os.path.join(folder, "any", "m")
    shutil.rmtree(os.path.join(folder, "any"), ignore_errors=True)
    with open(path, "w", encoding="utf-8") as f:
        json.dump(root, f, ensure_ascii=rng.random() < 0.5)
    done = subprocess.run([apsm, "groom", path, "-o", model, "--faces", "100", "-q"], cwd=folder,
                          capture_output=True, text=True)
    if done.returncode != 0:
        print("FAILED: project %d: %s" % (seed, done.stderr))
        failed = 1
        continue
    with open(os.path.join(model, "project.swproj"), encoding="utf-8") as f:
        what = lost(domain, kind, root, json.load(f))
    if what:
        print("FAILED: project %d lost %s" % (seed, what))
        failed = 1
sys.exit(failed)
