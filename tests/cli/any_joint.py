"""Generated projects of several domains: what `run` writes has lost nothing, opens in any folder, and holds what ShapeWorks
goes on with; what is not done is refused by name.  Arguments: the program, a folder with in/NAME_a.ply, in/NAME_b.ply,
in/NAME_c.ply of six NAMEs, and seeds.  Standard library only."""
import json
import os
import random
import shutil
import subprocess
import sys

apsm, folder, seeds = sys.argv[1], sys.argv[2], [int(s) for s in sys.argv[3:]]
MADE = ("groomed_", "local_particles_", "world_particles_", "alignment_", "procrustes_")
PATHS = ("landmarks_file_", "image_", "feature_", "shape_", "segmentation_", "mesh_", "constraints_")
QUICK = ["-J", "12", "--faces", "300", "--stage1-epochs", "1", "--stage2-epochs", "1", "--fidelity-rounds", "2", "--other-templates", "0",
         "--specificity-samples", "10", "--threads", "1", "-q"]


def write(name, content):
    with open(os.path.join(folder, name), "w", encoding="utf-8") as f:
        f.write(content)
    return name


def project(rng):
    domains = rng.choice([["1", "2"], ["femur", "tibia"], ["1", "2", "3"], ["b", "a"]])
    kind = rng.choice(["shape_", "mesh_", "shape_"])
    columns = rng.sample(["group_side", "notes", "image_ct", "feature_w", "apsm_x", ""], rng.randint(1, 5))
    rows, wants = [], set()
    for i in range(6):
        row = {"name": "n%d" % i}
        for d, part in zip(domains, "abc"):
            row[kind + d] = "in/n%d_%s.ply" % (i, part)
        for c in columns:
            row[c] = rng.choice(["", "in/n0_a.ply"] if c.startswith(PATHS) else ["", "L", "4.5", "é", "two words", True, 7])
        if rng.random() < 0.3:
            row["alignment_" + domains[0]] = "1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1"
            row["alignment_global"] = "1 0 0 0 0 1 0 0 0 0 1 0"
        rows.append(row)
    for d in domains:  # of every domain its own
        if rng.random() < 0.4:
            for row in rows:
                row["landmarks_file_" + d] = write("lm_%s_%s.csv" % (row["name"], d), "name,x,y,z\none,1,2,3\ntwo,4,5,6\n")
        if rng.random() < 0.3:
            high = {"planes": [{"points": [[0, 0, 900], [0, 9, 900], [9, 0, 900]]}]}
            for row in rows:
                row["constraints_" + d] = write("c_%s_%s.json" % (row["name"], d), json.dumps(high))
    if rng.random() < 0.5:
        rows[rng.randrange(6)]["excluded"] = rng.choice(["yes", "TRUE", True])
    if rng.random() < 0.4:  # a subject without its last part
        del rows[rng.randrange(3)][kind + domains[-1]]
    if rng.random() < 0.25:
        rows[5]["fixed"] = "yes"
        wants.add("fixed")
    root = {"data": rows, "studio": {"notes": "mine"}, "mine": {"k": {"x": ["y"]}}, "deepssm": {}}
    root["optimize"] = {"relative_weighting": "3", "number_of_particles": " ".join("64" for _ in domains), "use_normals": "0"}
    if rng.random() < 0.25:
        root["groom"] = {domains[0]: {"reflect": "true"}}
        wants.add("reflect")
    else:
        root["groom"] = {d: {"smooth": "true"} for d in domains}
    return domains, kind, root, wants


def text(v):
    return ("true" if v else "false") if isinstance(v, bool) else v if isinstance(v, str) else repr(v)


def yes(row, key):
    return text(row.get(key, "no")).lower() in ("yes", "true", "1")


def reaches(where, stored, wanted):
    return os.path.normpath(os.path.join(where, stored)) == os.path.normpath(os.path.join(folder, wanted))


def lost(domains, kind, before, model):
    with open(os.path.join(model, "project.swproj"), encoding="utf-8") as f:
        after = json.load(f)
    rows = {r["name"]: r for r in after["data"]}
    for row in before["data"]:
        now, whole = rows.get(row["name"]), all(kind + d in row for d in domains)
        if now is None:
            if whole or yes(row, "excluded"):
                return "subject %s" % row["name"]
            continue  # it lacks a part: said, and in the parts' own projects
        for key, v in row.items():
            if key.startswith(MADE):
                continue
            here = now.get("shape_" + key[len(kind):]) if key.startswith(kind) and not yes(row, "excluded") else now.get(key)
            if here is None or (reaches(model, here, v) if key.startswith(PATHS) and text(v) else text(v) == here) is False:
                return "%s of %s: %r, now %r" % (key, row["name"], v, here)
        if yes(row, "excluded"):
            continue
        for d in domains:
            for key in ("groomed_", "local_particles_", "world_particles_"):
                path = now[key + d]
                if os.path.isabs(path) or not os.path.exists(os.path.join(model, path)):
                    return "%s%s of %s: %s is not there" % (key, d, row["name"], path)
            with open(os.path.join(model, now["local_particles_" + d]), encoding="utf-8") as f:
                if len(f.readlines()) != 12:
                    return "particles of %s" % row["name"]
            for key in ("alignment_", "procrustes_"):
                if len(now[key + d].split()) != 16:
                    return key + d
    optimize = after["optimize"]
    if optimize.get("number_of_particles") != " ".join("12" for _ in domains) or optimize.get("relative_weighting") != "3":
        return "optimize: %r" % optimize
    for group in ("studio", "mine", "deepssm", "groom"):
        if after.get(group) != before[group]:
            return "group %s: %r, now %r" % (group, before[group], after.get(group))
    return None


failed = 0
for seed in seeds:
    domains, kind, root, wants = project(random.Random(seed))
    path, model = os.path.join(folder, "any.swproj"), os.path.join(folder, "any", "m")
    shutil.rmtree(os.path.join(folder, "any"), ignore_errors=True)
    write("any.swproj", json.dumps(root))
    what = None
    for ignore in [None, ",".join(sorted(wants))] if wants else [None]:
        done = subprocess.run([apsm, "run", path, "-o", model] + QUICK + (["--ignore", ignore] if ignore else []), cwd=folder, capture_output=True, text=True)
        refused = bool(wants) and not ignore
        if refused and (done.returncode == 0 or not any("--ignore " + w in done.stderr or w in done.stderr for w in wants) or os.path.exists(model)):
            what = "is not refused by name (%s): %s" % (wants, done.stderr[-300:])
        elif not refused and done.returncode != 0:
            what = "failed: %s" % done.stderr[-300:]
    if not what:
        what = lost(domains, kind, root, model)
    info = subprocess.run([apsm, "info", model], cwd="/", capture_output=True, text=True)
    if not what and (info.returncode != 0 or "do not belong" in info.stdout or "absent" in info.stdout):
        what = "info doubts what was written: %s" % info.stdout[-300:]
    if what:
        print("FAILED: project %d of domains %s: %s" % (seed, domains, what))
        failed = 1
sys.exit(failed)
