"""The Python module gives what the program gives, to the last bit, and its errors are exceptions."""
import array
import math
import os
import struct
import subprocess
import sys
import tempfile
import threading
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
