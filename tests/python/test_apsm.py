"""The Python module gives what the program gives, to the last bit, and its errors are exceptions."""
import array
import importlib.util
import inspect
import json
import math
import os
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings

import apsm

PROGRAM, SYNTHETIC = os.environ["APSM_PROGRAM"], os.environ["APSM_SYNTHETIC"]
FAST = {"particles": 32, "faces": 1000, "stage1_epochs": 3, "stage2_epochs": 2}


def read_ply(path):
    """Vertices and faces of a binary PLY of float32 and uchar + int32."""
    data = open(path, "rb").read()
    head, body = data.split(b"end_header\n", 1)
    nv = int(head.split(b"element vertex ")[1].split()[0])
    nf = int(head.split(b"element face ")[1].split()[0])
    V = array.array("d", struct.unpack(f"<{3 * nv}f", body[: 12 * nv]))
    rows = struct.iter_unpack("<B3i", body[12 * nv : 12 * nv + 13 * nf])
    return V, array.array("I", [k for row in rows for k in row[1:]])


class Cohort(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = staticmethod(lambda *p: os.path.join(cls.folder.name, *p))
        os.mkdir(cls.path("shapes"))
        for i in range(6):
            subprocess.run([SYNTHETIC, "ellipsoid", cls.path("shapes", f"s{i}.ply"), "level", "3",
                            "index", str(i), "count", "6", "wobble", "0.02", "seed", str(i + 1)],
                           check=True)
        cls.shapes = {f"s{i}": read_ply(cls.path("shapes", f"s{i}.ply")) for i in range(6)}
        warnings.simplefilter("ignore")
        cls.model = apsm.run(cls.shapes, threads=2, **FAST)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_model(self):
        m = self.model
        self.assertEqual(m.names, [f"s{i}" for i in range(6)])
        self.assertEqual(len(m.particles), 6)
        self.assertEqual(len(m.mean), 32)
        mean = [sum(m.particles[i, 5, a] for i in range(6)) / 6 for a in range(3)]
        for a in range(3):
            self.assertAlmostEqual(m.mean[5, a], mean[a], places=9)
        # particles are mean + sum of scores times modes
        for i in (0, 3):
            again = m.shape([m.scores[i, k] for k in range(len(m.variances))])
            self.assertAlmostEqual(again[7][2], m.particles[i, 7, 2], places=8)
        self.assertIn(m.template, m.names)
        self.assertEqual(set(m.table()), {"name", "certified"} | {f"mode_{k + 1}" for k in range(len(m.variances))})
        self.assertIn("6 shapes, 32 particles", repr(m))

    def test_same_bytes_as_the_program(self):
        out = self.path("model")
        options = [f"--{k.replace('_', '-')}={v}" for k, v in FAST.items()]
        subprocess.run([PROGRAM, "run", self.path("shapes"), "-o", out, "--quiet", *options],
                       check=True, capture_output=True)
        for i in range(6):
            lines = open(os.path.join(out, "particles", f"s{i}_world.particles")).read().split("\n")
            for j in (0, 31):
                want = [float(x) for x in lines[j].split()]
                self.assertEqual([self.model.particles[i, j, a] for a in range(3)], want)
        apsm.run_files(self.path("shapes"), self.path("again"), threads=1, **FAST)
        self.assertEqual(open(os.path.join(out, "model.json"), "rb").read(),
                         open(self.path("again", "model.json"), "rb").read())
        self.check_fit(out)
        self.check_test(out)

    def test_what_a_model_in_memory_can_be_asked(self):
        """A model of arrays is put into a folder when that is needed, and is the same model there."""
        m = self.model
        saved = m.save(self.path("saved"))
        self.assertEqual(saved.names, m.names)
        self.assertEqual(bytes(memoryview(saved.particles).cast("B")), bytes(memoryview(m.particles).cast("B")))
        self.assertEqual(saved.template, m.template)
        self.assertLess(max(abs(saved.scores[i, 0]) - abs(m.scores[i, 0]) for i in range(6)), 1e-9)
        self.assertEqual(set(saved.table()), set(m.table()))
        with self.assertRaisesRegex(apsm.Error, "holds a model already"):
            m.save(self.path("saved"))
        self.assertEqual(saved.certified, m.certified)
        table = {"name": m.names, "x": range(6), "note": ["a", None, "b", "", "c", float("nan")]}
        for model in (m, saved):
            self.assertEqual(model.test("~ x", on="size", subjects=table)["permutations"], 720)
            fit = model.fit(*self.shapes["s3"], force=True)
            self.assertEqual(len(fit.world), 32)
        with self.assertRaises(AttributeError):
            saved.nothing
        judged = apsm.certify({n: m.world_mesh(n) for n in m.names}, m.particles, template=m.template)
        self.assertEqual({s["name"]: s["verdict"] == "certified" for s in judged["per_shape"]}, m.certified)
        with self.assertRaisesRegex(ValueError, "no shape 'z'"):
            apsm.certify({n: m.world_mesh(n) for n in m.names}, m.particles, template="z")
        meshes = {n: m.world_mesh(n) for n in m.names}
        vertices, faces = meshes[m.names[1]]
        beyond = dict(meshes, **{m.names[1]: (vertices, [[a, b, len(vertices)] for a, b, _ in faces.tolist()])})
        with self.assertRaisesRegex(apsm.Error, m.names[1]):
            apsm.certify(beyond, m.particles)
        outside = {("../" + n if i == 0 else n): meshes[n] for i, n in enumerate(m.names)}
        with self.assertRaisesRegex(apsm.Error, "slashes"):
            apsm.save(self.path("outside"), outside, m.particles)
        with self.assertRaisesRegex(ValueError, "shapes, particles, 3"):
            apsm.save(self.path("short"), {n: m.world_mesh(n) for n in m.names}, [0.0] * 21)

    def test_points_and_landmarks(self):
        model = self.asked()
        V, F = self.shapes["s4"]
        whole = model.fit(V, F, force=True)
        cloud = model.fit_points(V, force=True)
        self.assertEqual(len(cloud.world), 32)
        far = max(abs(cloud.world[j, a] - whole.world[j, a]) for j in range(32) for a in range(3))
        self.assertLess(far, 5)
        mean = [[model.mean[j, a] for a in range(3)] for j in range(0, 32, 4)]
        marks = model.fit_landmarks(mean, mean, aligned=True)  # the mean itself
        self.assertLess(max(abs(x) for x in marks.scores), 1e-6)
        with self.assertRaisesRegex(ValueError, "as many landmarks"):
            model.fit_landmarks(mean, mean[:4])
        with self.assertRaisesRegex(ValueError, "hand: auto, same or other"):
            model.fit(V, F, hand="left")
        model.export_model(self.path("one.apsm"))
        moved = apsm.load(self.path("one.apsm")).fit(V, F, force=True)
        self.assertEqual(bytes(memoryview(moved.world).cast("B")), bytes(memoryview(whole.world).cast("B")))

    def asked(self):
        """A model of eight in a folder, made once."""
        if not os.path.isdir(self.path("asked")):
            more = [self.path(f"s{i}.ply") for i in (6, 7)]
            for i, path in enumerate(more):
                subprocess.run([SYNTHETIC, "ellipsoid", path, "level", "3", "index", str(i + 2), "count", "6", "wobble",
                                "0.02", "seed", str(i + 40)], check=True)
            apsm.run_files([self.path("shapes"), *more], self.path("asked"), threads=1, **FAST)
        return apsm.load(self.path("asked"))

    def test_answers_are_those_of_the_program(self):
        model = self.asked()
        table = self.path("known.csv")
        with open(table, "w") as file:
            file.write("name,x\n" + "".join(f"s{i},{i * i}\n" for i in range(8)) + "n0,3\nn1,9\n")
        os.mkdir(self.path("new"))
        for i in (0, 1):
            subprocess.run([SYNTHETIC, "ellipsoid", self.path("new", f"n{i}.ply"), "level", "3", "index", str(2 * i + 1),
                            "count", "6", "wobble", "0.02", "seed", str(i + 20)], check=True)
        fits = model.fit_files(self.path("new"), self.path("fits"), force=True, threads=2)
        self.assertEqual(fits["name"], ["n0", "n1"])
        self.assertTrue(os.path.exists(self.path("fits", "report.html")))

        def program(*words):
            subprocess.run([PROGRAM, *words, "--quiet"], check=True, capture_output=True)

        definition = {"measurements": [{"name": "length", "kind": "distance", "points": [1, 20]}, {"name": "volume", "kind": "volume"}]}
        measured = model.measure(definition)
        with open(self.path("definition.json"), "w") as file:
            json.dump(definition, file)
        program("measure", self.path("asked"), self.path("definition.json"), "-o", self.path("measured"))
        with open(self.path("measured", "measurements.csv")) as file:
            head, first, *_ = file.read().split("\n")
        self.assertEqual(list(measured), head.split(","))
        self.assertEqual(measured["volume"][0], float(first.split(",")[head.split(",").index("volume")]))

        norm = model.norm(self.path("fits"), out=self.path("normed"))
        self.assertTrue(os.path.exists(self.path("normed", "norm.html")))
        program("norm", self.path("asked"), self.path("fits"), "-o", self.path("norm2"))
        with open(self.path("norm2", "norm.json")) as file:
            self.assertEqual(norm, json.load(file))
        with self.assertRaisesRegex(apsm.Error, "too few"):
            model.norm(self.path("fits"), formula="~ x + side", subjects={"name": [f"s{i}" for i in range(8)] + ["n0", "n1"],
                                                                               "x": range(10), "side": list("abcabcabca")})
        known = {"name": [f"s{i}" for i in range(8)], "x": [3, 1, 4, 1.5, 5, 9, 2, 6]}
        with self.assertRaisesRegex(apsm.Error, "10 are needed to learn from"):
            model.predict("x", subjects=known)
        same = apsm.compare(self.path("asked"), self.path("asked"))
        self.assertLess(same["mean_distance"]["mean"], 1e-6)
        self.assertEqual(apsm.verify(self.path("asked")), [])
        marks = self.path("marks.csv")
        with open(marks, "w") as file:
            file.write("name,x,y,z\n" + "".join(f"p{j},{','.join(repr(float(model.mean[j, a])) for a in range(3))}\n" for j in (0, 9)))
        placed = model.landmarks(marks, aligned=True)
        self.assertGreater(len(placed), 3)

    def test_growing_and_shrinking(self):
        folder = self.path("grown")
        apsm.run_files(self.path("shapes"), folder, threads=1, **FAST)
        apsm.exclude(folder, [n for n in self.model.names if n != apsm.load(folder).template][:1])
        self.assertEqual(len(apsm.load(folder).names), 5)
        self.assertTrue(os.path.getsize(apsm.report(folder)) > 100000)
        self.assertEqual(apsm.verify(folder), [])
        with self.assertRaisesRegex(apsm.Error, "zzz"):
            apsm.exclude(folder, "zzz")

    def test_joint(self):
        os.mkdir(self.path("parts"))
        for i in range(5):
            for part, move in (("upper", 0), ("lower", 60)):
                V, F = self.shapes[f"s{i}"]
                with open(self.path("parts", f"p{i}_{part}.obj"), "w") as file:
                    for k in range(0, len(V), 3):
                        file.write(f"v {V[k]} {V[k + 1]} {V[k + 2] + move + i}\n")
                    for k in range(0, len(F), 3):
                        file.write(f"f {F[k] + 1} {F[k + 1] + 1} {F[k + 2] + 1}\n")
        apsm.run_files(self.path("parts"), self.path("joint"), parts="upper=_upper,lower=_lower", threads=2, **FAST)
        joint = apsm.load(self.path("joint"))
        self.assertEqual(joint.names, [f"p{i}" for i in range(5)])
        self.assertEqual(len(joint.mean), 64)
        rows = joint.fit_files(self.path("parts"), self.path("jointfits"), force=True)
        self.assertEqual(len(rows[next(iter(rows))]), 5)

    def test_ctrl_c_ends_what_tells_no_progress(self):
        """A signal from outside, while a long test runs, raises KeyboardInterrupt within a moment."""
        self.asked()
        program = ("import apsm, sys, time\ntry:\n    apsm.test(sys.argv[1], '~ x', subjects={'name': ['s%d' % i for i in range(8)], "
                   "'x': [3, 1, 4, 1, 5, 9, 2, 6]}, permutations=100, bootstraps=400000, threads=1)\nexcept KeyboardInterrupt:\n"
                   "    print('interrupted')\nprint(apsm.verify(sys.argv[1]))\n")
        job = subprocess.Popen([sys.executable, "-c", program, self.path("asked")], stdout=subprocess.PIPE, text=True)
        time.sleep(1.5)
        self.assertIsNone(job.poll(), "the test was over too soon to be interrupted")
        job.send_signal(signal.SIGINT)
        began = time.monotonic()
        said, _ = job.communicate(timeout=60)
        self.assertEqual(said.split("\n")[:2], ["interrupted", "[]"])
        self.assertLess(time.monotonic() - began, 20)

    def test_everything_is_described(self):
        for name in apsm.__all__:
            thing = getattr(apsm, name)
            self.assertTrue(thing.__doc__, name)
            functions = [thing] if not isinstance(thing, type) else [
                f for n, f in vars(thing).items() if callable(f) and not n.startswith("_")]
            for f in functions:
                if isinstance(f, type):
                    continue
                self.assertTrue(f.__doc__, f"{name}: {f}")
                hints = getattr(f, "__annotations__", {})
                wanted = [p for p in inspect.signature(f).parameters if p not in ("self", "how")]
                self.assertTrue(set(wanted) <= set(hints) and "return" in hints, f"{name}: {f} has {sorted(hints)}")

    @unittest.skipIf(importlib.util.find_spec("pandas") is None, "SKIPPED: no pandas")
    def test_pandas(self):
        import pandas

        frame = pandas.DataFrame(self.model.table())
        self.assertEqual(len(frame), 6)
        frame["x"] = range(6)
        found = self.model.test("~ x", on="size", subjects=frame[["name", "x"]])
        self.assertEqual(found["subjects"], 6)

    @unittest.skipIf(importlib.util.find_spec("nibabel") is None, "SKIPPED: no nibabel")
    def test_nibabel(self):
        import nibabel
        import numpy

        grid = numpy.indices((24, 24, 24)) - 12.0
        images = {}
        for s in range(4):
            r = numpy.array([6 + s, 7, 8])[:, None, None, None]
            image = nibabel.Nifti1Image(((grid / r) ** 2).sum(0).__lt__(1).astype("i2"), numpy.diag([-1.0, -1, 1, 1]))
            images[f"v{s}"] = image
            nibabel.save(image, self.path(f"v{s}.nii.gz"))
        model = apsm.run(images, **FAST)
        apsm.run_files([self.path(f"v{s}.nii.gz") for s in range(4)], self.path("niftis"), threads=1, **FAST)
        self.assertEqual(bytes(memoryview(model.particles).cast("B")),
                         bytes(memoryview(apsm.load(self.path("niftis")).particles).cast("B")))

    def check_fit(self, folder):
        model = apsm.load(folder)
        fit = model.fit(*self.shapes["s2"], force=True)
        self.assertIn(fit.verdict, ("good", "needs review"))
        self.assertEqual(len(fit.world), 32)
        self.assertTrue(0 <= fit.tail <= 1)
        self.assertTrue(fit.surface_mean < 5)
        ball = [(math.cos(a), math.sin(a), 0) for a in range(3)]
        with self.assertRaises(apsm.Error):
            model.fit(ball, [(0, 1, 9)])

    def check_test(self, folder):
        table = self.path("table.csv")
        with open(table, "w") as file:
            file.write("name,x\n" + "".join(f"s{i},{i}\n" for i in range(6)))
        found = apsm.test(folder, "~ x", on="size", subjects=table)
        self.assertEqual(found["permutations"], 720)
        self.assertTrue(0 < found["p"] <= 1)
        self.assertEqual(apsm.test(folder, "~ x", on="size", subjects=table, variances="unequal")["variances"], "unequal")
        with self.assertRaisesRegex(apsm.Error, "5 at least are needed"):
            sides = self.path("sides.csv")
            with open(sides, "w") as file:
                file.write("name,side,person\n" + "".join(f"s{i},{'lr'[i % 2]},p{i // 2}\n" for i in range(6)))
            apsm.asymmetry(folder, of="side", within="person", subjects=sides)
        with self.assertRaisesRegex(apsm.Error, "no column 'y'"):
            apsm.test(folder, "~ y", subjects=table)

    def test_order_and_threads_do_not_matter(self):
        turned = dict(reversed(list(self.shapes.items())))
        again = apsm.run(turned, threads=1, **FAST)
        self.assertEqual(bytes(memoryview(again.particles).cast("B")),
                         bytes(memoryview(self.model.particles).cast("B")))

    def test_errors(self):
        V, F = self.shapes["s0"]
        with self.assertRaisesRegex(apsm.Error, "partciles"):
            apsm.run(self.shapes, partciles=32)
        with self.assertRaises(apsm.Error):
            apsm.run({})
        with self.assertRaises((apsm.Error, ValueError)):
            apsm.run({"a": (V[:-1], F), "b": (V, F), "c": (V, F)})
        with self.assertRaises(apsm.Error):
            apsm.run({"a": ([math.nan] * 9, [0, 1, 2])})
        with self.assertRaises(TypeError):
            apsm.run({"a": 3})
        with self.assertRaisesRegex(ValueError, "no shape 'z'"):
            apsm.run(self.shapes, reflect=["z"])
        with self.assertRaises(apsm.Error):
            apsm.load(self.path("nothing"))

    def test_progress_and_what_it_raises(self):
        seen = []
        apsm.run(self.shapes, progress=lambda stage, done, total: seen.append(stage), **FAST)
        self.assertIn("groom", seen)

        def stop(stage, done, total):
            raise KeyboardInterrupt

        with self.assertRaises(KeyboardInterrupt):
            apsm.run(self.shapes, progress=stop, **FAST)

    def test_other_python_threads_run(self):
        ticks, done = [], threading.Event()

        def tick():
            while not done.wait(0.001):
                ticks.append(1)

        worker = threading.Thread(target=tick)
        worker.start()
        apsm.run(self.shapes, threads=1, **FAST)
        done.set()
        worker.join()
        self.assertGreater(len(ticks), 5)

    def test_warp(self):
        m, near = self.model, 1e-6
        shape = [[m.particles[3, j, a] for a in range(3)] for j in range(32)]
        own = [[m.particles[m.names.index(m.template), j, a] for a in range(3)] for j in range(32)]
        # Particles of the template go to those of the shape, and to their own under the identity.
        there = m.warp(shape, own)
        self.assertLess(max(abs(there[j, a] - shape[j][a]) for j in range(32) for a in range(3)), near)
        both = apsm.warp(own, [own, shape], own)
        self.assertEqual(tuple(both.shape), (2, 32, 3))
        self.assertLess(max(abs(both[0, j, a] - own[j][a]) for j in range(32) for a in range(3)), near)
        self.assertEqual(len(m.warp(shape)), len(m.meshes[m.template][0]))
        with self.assertRaises(ValueError):
            apsm.warp(own, own[:5], own)
        with self.assertRaises(apsm.Error):
            apsm.warp([[0.0, 0.0, 0.0]] * 4, [[0.0, 0.0, 0.0]] * 4, own)

    def test_export(self):
        out = self.path("exported")
        apsm.run_files(self.path("shapes"), out, threads=1, **FAST)
        apsm.export(out, "csv", self.path("tables"), modes=1)
        with open(self.path("tables", "modes.csv"), encoding="utf-8") as file:
            self.assertEqual(file.readline().strip(), "mode_1_x,mode_1_y,mode_1_z")
        with self.assertRaisesRegex(apsm.Error, "overwrite"):
            apsm.export(out, "csv", self.path("tables"))
        apsm.export(out, "ply", self.path("plys"), modes=1, sd=[1, 3])
        self.assertEqual(len(os.listdir(self.path("plys", "modes"))), 4)

    def test_volume(self):
        n = 24
        labels = {}
        for s in range(4):
            r = (6 + s, 7, 8)
            labels[f"v{s}"] = apsm.Volume(
                [int(sum(((x - 12) / q) ** 2 for x, q in zip((i, j, k), r)) < 1)
                 for k in range(n) for j in range(n) for i in range(n)], (n, n, n), (1, 1, 1))
        model = apsm.run(labels, **FAST)
        extent = [max(model.particles[i, j, a] for j in range(32)) - min(model.particles[i, j, a] for j in range(32))
                  for i in (0, 3) for a in range(3)]
        self.assertTrue(all(8 < e < 20 for e in extent), extent)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v"])
