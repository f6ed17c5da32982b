"""apsm: statistical shape models from meshes and segmentations.

    import apsm
    model = apsm.run({"a": (vertices, faces), ...}, particles=128)
    model.mean, model.modes, model.variances, model.scores
    fit = apsm.load("model").fit(vertices, faces)

Arrays come in as anything with a buffer or as nested sequences.  They go out as NumPy arrays where
NumPy is installed, else as memoryviews of the same shape, which index, slice and tolist() alike.
Shapes may also be objects with .vertices and .faces (trimesh), .points and .regular_faces or .faces
(PyVista), or images with .get_fdata() and .affine (nibabel).
"""

from __future__ import annotations

import array
import json
import os
import tempfile
from typing import Any, Callable, Iterable, Mapping, Optional

try:
    import numpy as _np
except ImportError:  # everything works without
    _np = None

__all__ = ["Error", "Model", "Fit", "FittedModel", "Volume", "run", "run_files", "load", "test",
           "export", "warp"]


class Error(Exception):
    """What the library refuses or fails at, in one line that says what to do; .status is its kind."""

    def __init__(self, line: str, status: str = ""):
        super().__init__(line)
        self.status = status




def _pinned_kernels():
    """Loads with OpenBLAS's kernels of Haswell, as the program has them, so that bytes are the same
    on all x86-64 processors with AVX2; what is loaded before or after keeps its own."""
    name = "OPENBLAS_CORETYPE"
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            flags = next((line.split() for line in file if line.startswith("flags")), [])
    except OSError:
        flags = []
    pins = name not in os.environ and "avx2" in flags and "fma" in flags
    if pins:
        os.environ[name] = "Haswell"
    try:
        from . import _apsm  # it looks for Error here
    finally:
        if pins:
            del os.environ[name]
    return _apsm


_apsm = _pinned_kernels()


# ---- arrays ----


def _out(data: Optional[bytes], *shape: int, code: str = "d"):
    """Bytes of the library as an array of that shape."""
    if data is None:
        return None
    if _np is not None:
        return _np.frombuffer(data, dtype={"d": "f8", "I": "u4"}[code]).reshape(shape)
    view = memoryview(data)
    return view.cast(code, shape) if len(data) else view.cast(code)


def _flatten(value, into: list) -> None:
    for item in value:
        if hasattr(item, "__iter__"):
            _flatten(item, into)
        else:
            into.append(item)


def _in(value, code: str):
    """A flat buffer of doubles, unsigned or signed 32-bit integers."""
    if _np is not None:
        kind = {"d": "f8", "I": "u4", "i": "i4"}[code]
        given = _np.asarray(value)
        if code != "d" and given.size and (given.min() < 0) and code == "I":
            raise ValueError("faces are numbers of vertices, from 0 on")
        return _np.ascontiguousarray(given, dtype=kind)
    if isinstance(value, memoryview) and value.format == code and value.contiguous:
        return value
    flat: list = []
    _flatten(value, flat)
    return array.array(code, flat)


class Volume:
    """A segmentation: labels[k][j][i] (z, y, x), spacing, origin and direction in LPS mm."""

    def __init__(self, labels, size, spacing, origin=(0, 0, 0), direction=(1, 0, 0, 0, 1, 0, 0, 0, 1)):
        self.labels, self.size = labels, tuple(int(n) for n in size)
        self.spacing = tuple(float(x) for x in spacing)
        self.origin = tuple(float(x) for x in origin)
        self.direction = tuple(float(x) for x in direction)

    def _pack(self):
        return (_in(self.labels, "i"), self.size, self.spacing, self.origin, self.direction)


def _from_nibabel(image) -> Volume:
    """RAS affine to LPS geometry; needs NumPy, as nibabel does."""
    affine = _np.diag([-1, -1, 1, 1]) @ _np.asarray(image.affine, dtype=float)
    spacing = _np.linalg.norm(affine[:3, :3], axis=0)
    labels = _np.rint(_np.asarray(image.dataobj)).astype("i4").transpose(2, 1, 0)
    return Volume(labels, labels.shape[::-1], spacing, affine[:3, 3],
                  (affine[:3, :3] / spacing).ravel())


def _mesh(shape):
    """(vertices, faces) of whatever is given."""
    if isinstance(shape, (tuple, list)) and len(shape) == 2:
        return shape[0], shape[1]
    if hasattr(shape, "vertices") and hasattr(shape, "faces"):
        return shape.vertices, shape.faces
    if hasattr(shape, "points") and hasattr(shape, "faces"):
        faces = getattr(shape, "regular_faces", None)
        return shape.points, shape.faces.reshape(-1, 4)[:, 1:] if faces is None else faces
    raise TypeError("a shape is (vertices, faces), a Volume, or an object with vertices and faces")


def _pack(name: str, shape, reflect: bool):
    if hasattr(shape, "affine") and hasattr(shape, "dataobj"):
        shape = _from_nibabel(shape)
    if isinstance(shape, Volume):
        return (name, reflect, shape._pack(), None)
    vertices, faces = _mesh(shape)
    return (name, reflect, _in(vertices, "d"), _in(faces, "I"))


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return ",".join(_text(v) for v in value)
    return repr(value) if isinstance(value, float) else str(value)


def _options(options: Mapping[str, Any]):
    return [(key, _text(value)) for key, value in options.items()]


def _logger(log: Optional[Callable[[str], None]]):
    """By default warnings become Python's warnings."""
    if log is not None:
        return lambda is_warning, line: log(("warning: " if is_warning else "") + line)

    def warn(is_warning: bool, line: str) -> None:
        if is_warning:
            import warnings

            warnings.warn(line, stacklevel=2)

    return warn


def _threads(threads: Optional[int]) -> int:
    return threads if threads else os.cpu_count() or 1


# ---- models ----


class Model:
    """A finished model: particles (I, J, 3), mean (J, 3), modes (K, J, 3), variances (K), scores (I, K)."""

    def __init__(self, result: dict):
        J, names = result["J"], result["names"]
        I, K = len(names), len(result["variances"]) // 8
        self.names = names
        self.particles = _out(result["particles"], I, J, 3)
        self.mean = _out(result["mean"], J, 3)
        self.modes = _out(result["modes"], K, J, 3)
        self.variances = _out(result["variances"], K)
        self.scores = _out(result["scores"], I, K)
        self.template = names[result["template"]]
        self.certified = {n: s[0] for n, s in zip(names, result["shapes"])}
        self.reasons = {n: s[1] for n, s in zip(names, result["shapes"])}
        self.to_world = {n: _out(s[2], 4, 4) for n, s in zip(names, result["shapes"])}
        self.meshes = {
            n: (_out(s[3][0], len(s[3][0]) // 24, 3), _out(s[3][1], len(s[3][1]) // 12, 3, code="I"))
            for n, s in zip(names, result["shapes"]) if s[3] is not None
        }
        self.figures = {k: _out(v, len(v) // 8) for k, v in result["figures"].items() if v is not None}

    def __repr__(self) -> str:
        sound = sum(self.certified.values())
        return f"<apsm.Model of {len(self.names)} shapes, {len(self.mean)} particles, {sound} certified>"

    def table(self):
        """Names, scores and verdicts as columns: a dictionary, which pandas.DataFrame takes."""
        columns = {"name": list(self.names)}
        for k in range(len(self.variances)):
            columns[f"mode_{k + 1}"] = [self.scores[i, k] for i in range(len(self.names))]
        columns["certified"] = [self.certified[n] for n in self.names]
        return columns

    def shape(self, scores: Iterable[float]):
        """Particles of the shape with these scores, as a list of triples or an array."""
        scores = list(scores)
        points = [[self.mean[j, a] + sum(b * self.modes[k, j, a] for k, b in enumerate(scores))
                   for a in range(3)] for j in range(len(self.mean))]
        return points if _np is None else _np.array(points)

    def warp(self, particles, points=None):
        """Points on or in the template (its mesh's vertices if none are given; in the world frame), as they lie
        on the shape or shapes with these particles: (n, 3), or (I, n, 3) of several."""
        if points is None:
            points = _moved(self.to_world[self.template], self.meshes[self.template][0])
        return warp(self.particles[self.names.index(self.template)] if _np is not None else _rows(self, self.template),
                    particles, points)


def _moved(M, points):
    """Points by the affine M (4, 4)."""
    rows = [[M[i, j] for j in range(4)] for i in range(3)]
    return [[r[0] * points[k, 0] + r[1] * points[k, 1] + r[2] * points[k, 2] + r[3] for r in rows]
            for k in range(len(points))]


def _rows(model, name):
    i = model.names.index(name)
    return [[model.particles[i, j, a] for a in range(3)] for j in range(len(model.mean))]


def run(shapes: Mapping[str, Any], *, reflect: Iterable[str] = (), threads: Optional[int] = None,
        log: Optional[Callable[[str], None]] = None,
        progress: Optional[Callable[[str, int, int], None]] = None, **options: Any) -> Model:
    """A model of shapes in memory; options are those of docs/options.md (particles=128, label=...).

    reflect names the shapes to mirror.  Ctrl-C ends it.  Raises Error with the library's line.
    """
    mirrored = set(reflect)
    unknown = mirrored - set(shapes)
    if unknown:
        raise ValueError(f"reflect: no shape '{sorted(unknown)[0]}'")
    packed = [_pack(name, shape, name in mirrored) for name, shape in shapes.items()]
    return Model(_apsm.run(packed, _options(options), _threads(threads), _logger(log), progress))


def run_files(inputs, folder: str, *, overwrite: bool = False, resume: bool = False,
              threads: Optional[int] = None, log: Optional[Callable[[str], None]] = None,
              progress: Optional[Callable[[str, int, int], None]] = None, **options: Any) -> None:
    """What `apsm run INPUT... -o FOLDER` does; the same files."""
    if isinstance(inputs, (str, os.PathLike)):
        inputs = [inputs]
    _apsm.run_files(os.fspath(folder), [os.fspath(i) for i in inputs], _options(options),
                    _threads(threads), overwrite, resume, _logger(log), progress)


# ---- new shapes ----


class Fit:
    """A shape by a model: verdict, reason, and unless it was refused particles in the model's frame
    (world) and the shape's own (original), scores, sd (J), mesh (vertices, faces), mahalanobis, tail."""

    def __init__(self, result: dict):
        J = result["J"]
        self.verdict, self.reason, self.mirrored = result["verdict"], result["reason"], result["mirrored"]
        if "world" not in result:
            return
        self.world, self.original = _out(result["world"], J, 3), _out(result["original"], J, 3)
        self.scores = _out(result["scores"], len(result["scores"]) // 8)
        self.sd = _out(result["sd"], J)
        self.to_world = _out(result["to_world"], 4, 4)
        V, F = result["mesh"]
        self.mesh = (_out(V, len(V) // 24, 3), _out(F, len(F) // 12, 3, code="I"))
        for key in ("mahalanobis", "tail", "observed_share", "surface_mean", "surface_max"):
            setattr(self, key, result[key])

    def __repr__(self) -> str:
        return f"<apsm.Fit: {self.verdict}{': ' + self.reason if self.reason else ''}>"


class FittedModel:
    """A finished model of a folder or a file of `apsm export`, to fit shapes that it has not seen."""

    def __init__(self, path: str):
        self.path = os.fspath(path)
        self._model = _apsm.fit_load(self.path)

    def fit(self, shape, faces=None, *, name: str = "shape", aligned: bool = False,
            force: bool = False) -> Fit:
        """shape: (vertices, faces), or vertices with faces, or an object that has both."""
        vertices, faces = _mesh(shape) if faces is None else (shape, faces)
        return Fit(_apsm.fit(self._model, name, _in(vertices, "d"), _in(faces, "I"), aligned, force))


def load(path: str) -> FittedModel:
    """The model of a folder that `apsm run` made, or of a file of `apsm export`."""
    return FittedModel(path)


# ---- statistics ----


def test(folder: str, formula: str, *, of: Optional[str] = None, on: str = "form",
         subjects: Optional[str] = None, within: Optional[str] = None, permutations: int = 10000,
         bootstraps: int = 1000, variances: str = "equal", stop_risk: float = 0, seed: int = 0,
         threads: Optional[int] = None, log: Optional[Callable[[str], None]] = None) -> dict:
    """What `apsm test` finds, as the dictionary of its JSON file (docs/formats.md)."""
    if variances not in ("equal", "unequal"):
        raise ValueError(f"variances: equal or unequal, not {variances!r}")
    return _tested((os.fspath(folder), formula, of, on, subjects, within),
                   (permutations, bootstraps or _NONE, seed, variances == "unequal", float(stop_risk),
                    _threads(threads), _logger(log)))[0]


def asymmetry(folder: str, *, of: str, within: str, on: str = "form", subjects: Optional[str] = None,
              permutations: int = 10000, seed: int = 0, threads: Optional[int] = None,
              log: Optional[Callable[[str], None]] = None) -> dict:
    """What `apsm asymmetry` finds: the dictionary of asymmetry_ON.json, with its tests as "directional" and, where
    sides were measured repeatedly, "fluctuating".  of: the column of the sides; within: of the subjects."""
    found = _tested((os.fspath(folder), None, of, on, subjects, within),
                    (permutations, _NONE, seed, False, 0.0, _threads(threads), _logger(log)))
    result = next(f for f in found if f["format"] == "apsm-asymmetry")
    for other in found:
        if "title" in other:
            result[other["title"].split()[0].lower()] = other
    return result


_NONE = (1 << 64) - 1


def _tested(given: tuple, how: tuple) -> list:
    """The JSON files that a test writes."""
    with tempfile.TemporaryDirectory() as out:
        _apsm.test(*given, out, *how)
        found = []
        for name in sorted(os.listdir(out)):
            if name.endswith(".json"):
                with open(os.path.join(out, name), encoding="utf-8") as file:
                    found.append(json.load(file))
        return found


# ---- other programs ----


def export(folder: str, to: str, out: str, *, modes: int = 0, sd: Iterable[float] = (), overwrite: bool = False,
           log: Optional[Callable[[str], None]] = None) -> None:
    """What `apsm export --to` writes: "vtp", "ply", "gltf", "monai", "slicermorph", "csv", "npz", ..."""
    _apsm.export(os.fspath(folder), to, os.fspath(out), modes, _in(list(sd), "d"), overwrite, _logger(log))


def warp(from_particles, particles, points):
    """Points (n, 3) on, in or near a template, as the warp carries them that takes its particles (J, 3) to those of
    a shape (J, 3), or of several (I, J, 3)."""
    P0, P, X = _in(from_particles, "d"), _in(particles, "d"), _in(points, "d")
    size = [len(memoryview(a).cast("B")) // 24 for a in (P0, P, X)]
    data = _apsm.warp(P0, P, X)
    several = size[1] != size[0]
    return _out(data, size[1] // size[0], size[2], 3) if several else _out(data, size[2], 3)
