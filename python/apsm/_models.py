"""Models: made of shapes in memory or of files, read from folders; and new shapes by them."""

from __future__ import annotations

import csv
import json
import os
import tempfile
from typing import Any, Iterable, Mapping, Optional, Union

from . import _answers
from ._core import (Array, Log, Path, Progress, Table, _apsm, _columns, _in, _logger, _mesh, _np, _options, _out, _pack, _threads)

_HANDS = ("auto", "same", "other")
_EXTENTS = ("auto", "whole", "part")


def _word(name: str, given: str, words: "tuple[str, ...]") -> int:
    if given not in words:
        raise ValueError(f"{name}: {', '.join(words[:-1])} or {words[-1]}, not {given!r}")
    return words.index(given)


# ---- new shapes ----


class Fit:
    """A shape by a model: verdict, reason, and unless it was refused particles in the model's frame
    (world) and the shape's own (original), scores, sd (J), mesh (vertices, faces), mahalanobis, tail
    (NaN: of so few shapes no mode holds for others)."""

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


class _Finished:
    """What every finished model can be asked; it lies in a folder, or is put into one when that is needed."""

    names: "list[str]"
    mean: Array
    modes: Array
    variances: Array
    scores: Array
    certified: "dict[str, bool]"
    _fitter: Any = None

    def _folder(self) -> str:
        raise NotImplementedError

    def _fit(self, name: str, kind: str, x: Any, other: Any, hand: str, extent: str, aligned: bool, force: bool,
             log: Log) -> Fit:
        if self._fitter is None:
            self._fitter = _apsm.fit_load(self._folder())
        return Fit(_apsm.fit(self._fitter, name, kind, x, other, _word("hand", hand, _HANDS),
                             _word("extent", extent, _EXTENTS), aligned, force, _logger(log)))

    def fit(self, shape: Any, faces: Any = None, *, name: str = "shape", hand: str = "auto", extent: str = "auto",
            aligned: bool = False, force: bool = False, log: Log = None) -> Fit:
        """A surface that the model has not seen: (vertices, faces), vertices with faces, or an object that has both.

        hand: "same" as the model's shapes, "other", or "auto"; extent: "whole", a "part", or "auto".  aligned: the
        shape lies in the model's frame.  force: fit what is not of the model's kind nevertheless.
        """
        vertices, faces = _mesh(shape) if faces is None else (shape, faces)
        return self._fit(name, "surface", _in(vertices, "d"), _in(faces, "I"), hand, extent, aligned, force, log)

    def fit_points(self, points: Any, *, name: str = "shape", hand: str = "auto", extent: str = "auto",
                   aligned: bool = False, force: bool = False, log: Log = None) -> Fit:
        """The same from points (n, 3) on the surface, in any order: a cloud, of all of it or of a part."""
        return self._fit(name, "points", _in(points, "d"), b"", hand, extent, aligned, force, log)

    def fit_landmarks(self, points: Any, on_mean: Any, *, name: str = "shape", hand: str = "auto",
                      aligned: bool = False, force: bool = False, log: Log = None) -> Fit:
        """The same from landmarks alone: points (n, 3) on the shape, and the same ones on the mean shape."""
        return self._fit(name, "landmarks", _in(points, "d"), _in(on_mean, "d"), hand, "auto", aligned, force, log)

    def fit_files(self, inputs: Union[Path, Iterable[Path]], folder: Path, **how: Any) -> "dict[str, list]":
        """What `apsm fit` does with files; see apsm.fit_files."""
        return fit_files(self._folder(), inputs, folder, **how)

    def export_model(self, path: Path) -> None:
        """All that fit needs in one file, to be used where the shapes are not: what `apsm export --model` writes."""
        if self._fitter is None:
            self._fitter = _apsm.fit_load(self._folder())
        _apsm.fit_save(self._fitter, os.fspath(path))

    def test(self, formula: str, **how: Any) -> dict:
        """Whether shape goes with a term of the formula; see apsm.test."""
        return _answers.test(self._folder(), formula, **how)

    def asymmetry(self, **how: Any) -> dict:
        """Left against right; see apsm.asymmetry."""
        return _answers.asymmetry(self._folder(), **how)

    def measure(self, definition: Union[Path, Mapping[str, Any]], **how: Any) -> "dict[str, list]":
        """Distances, angles, volumes of every shape; see apsm.measure."""
        return _answers.measure(self._folder(), definition, **how)

    def norm(self, files: Union[Path, Iterable[Path]], **how: Any) -> dict:
        """How unusual new shapes are; see apsm.norm."""
        return _answers.norm(self._folder(), files, **how)

    def predict(self, of: str, **how: Any) -> dict:
        """A column of the subjects' table from the shape; see apsm.predict."""
        return _answers.predict(self._folder(), of, **how)

    def landmarks(self, file: Path, **how: Any) -> "dict[str, list]":
        """Points placed once, on every shape; see apsm.landmarks."""
        return _answers.landmarks(self._folder(), file, **how)

    def export(self, to: str, out: Path, **how: Any) -> None:
        """The model for other programs; see apsm.export."""
        _answers.export(self._folder(), to, out, **how)

    def table(self) -> "dict[str, list]":
        """Names, scores and verdicts as columns: a dictionary, which pandas.DataFrame takes."""
        columns: "dict[str, list]" = {"name": list(self.names)}
        for k in range(len(self.variances)):
            columns[f"mode_{k + 1}"] = [self.scores[i, k] for i in range(len(self.names))]
        columns["certified"] = [self.certified[n] for n in self.names]
        return columns

    def shape(self, scores: Iterable[float]) -> Any:
        """Particles of the shape with these scores, as a list of triples or an array."""
        scores = list(scores)
        points = [[self.mean[j, a] + sum(b * self.modes[k, j, a] for k, b in enumerate(scores))
                   for a in range(3)] for j in range(len(self.mean))]
        return points if _np is None else _np.array(points)


# ---- models ----


class Model(_Finished):
    """A model in memory: names, particles (I, J, 3), mean (J, 3), modes (K, J, 3), variances (K), scores (I, K),
    template, certified and reasons by name, to_world, meshes (vertices, faces) and figures."""

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

    def save(self, folder: Path, *, threads: Optional[int] = None, log: Log = None,
             progress: Progress = None) -> "FittedModel":
        """Makes a model folder of it, with report, as `apsm import` does: evaluated and certified anew."""
        save(folder, {n: self.world_mesh(n) for n in self.names}, self.particles, template=self.template,
             threads=threads, log=log, progress=progress)
        return FittedModel(folder)

    def world_mesh(self, name: str) -> "tuple[Any, Array]":
        """The groomed mesh of a shape in the frame that all have in common: (vertices, faces)."""
        V, F = self.meshes[name]
        return _moved(self.to_world[name], V), F

    def _folder(self) -> str:
        if not hasattr(self, "_saved"):
            self._temporary = tempfile.TemporaryDirectory(prefix="apsm-")
            self._saved = os.path.join(self._temporary.name, "model")
            self.save(self._saved, log=lambda line: None)
        return self._saved

    def warp(self, particles: Any, points: Any = None) -> Array:
        """Points on or in the template (its mesh's vertices if none are given; in the world frame), as they lie
        on the shape or shapes with these particles: (n, 3), or (I, n, 3) of several."""
        if points is None:
            points = _moved(self.to_world[self.template], self.meshes[self.template][0])
        return _answers.warp(self.particles[self.names.index(self.template)] if _np is not None else _rows(self, self.template),
                    particles, points)


class FittedModel(_Finished):
    """A finished model in a folder, or in a file of `apsm export --model`, which can be fitted only.

    Of a folder: names, particles (I, J, 3), mean (J, 3), modes (K, J, 3), variances (K), scores (I, K), template,
    verdict, certified and reasons by name; read when first asked for.
    """

    def __init__(self, path: Path):
        self.path = os.fspath(path)
        if not os.path.isdir(os.path.join(self.path, "parts")):  # a joint has no fitter of its own
            self._fitter = _apsm.fit_load(self.path)

    def _folder(self) -> str:
        return self.path

    def __repr__(self) -> str:
        return f"<apsm.FittedModel {self.path}>"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not os.path.isdir(self.path):
            raise AttributeError(name)
        self._read()
        if name not in self.__dict__:
            raise AttributeError(f"a finished model has no {name!r}")
        return self.__dict__[name]

    def _json(self, name: str) -> dict:
        with open(os.path.join(self.path, name), encoding="utf-8") as file:
            return json.load(file)

    def _read(self) -> None:
        model, judged = self._json("model.json"), self._json("certificate.json")
        with open(os.path.join(self.path, "scores.csv"), encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))[1:]
        self.names = [row[0] for row in rows]
        K, J = len(model["variances"]), len(model["mean"])
        self.mean = _out(bytes(_in(model["mean"], "d")), J, 3)
        self.modes = _out(bytes(_in(model["modes"], "d")), K, J, 3)
        self.variances = _out(bytes(_in(model["variances"], "d")), K)
        self.scores = _out(bytes(_in([[float(x) for x in row[1:]] for row in rows], "d")), len(rows), K)
        self.verdict, self.template = judged["verdict"], judged["template"]
        self.certified = {s["name"]: s["verdict"] == "certified" for s in judged["per_shape"]}
        self.reasons = {s["name"]: s.get("reasons", []) for s in judged["per_shape"]}
        parts = [f"_{p['name']}" for p in model.get("parts", [])] or [""]
        self.particles = _out(bytes(_in([[x for part in parts for x in self._particles(name + part)]
                                         for name in self.names], "d")), len(rows), J, 3)

    def _particles(self, name: str) -> "list[list[float]]":
        with open(os.path.join(self.path, "particles", f"{name}_world.particles"), encoding="utf-8") as file:
            return [[float(x) for x in line.split()[:3]] for line in file if line.strip()]


def _moved(M: Array, points: Array) -> "list[list[float]]":
    """Points by the affine M (4, 4)."""
    rows = [[M[i, j] for j in range(4)] for i in range(3)]
    return [[r[0] * points[k, 0] + r[1] * points[k, 1] + r[2] * points[k, 2] + r[3] for r in rows]
            for k in range(len(points))]


def _rows(model: Model, name: str) -> "list[list[float]]":
    i = model.names.index(name)
    return [[model.particles[i, j, a] for a in range(3)] for j in range(len(model.mean))]


def run(shapes: Mapping[str, Any], *, reflect: Iterable[str] = (), threads: Optional[int] = None, log: Log = None,
        progress: Progress = None, **options: Any) -> Model:
    """A model of shapes in memory; options are those of docs/options.md (particles=128, label=...).

    reflect names the shapes to mirror.  Ctrl-C ends it.  Raises Error with the library's line.
    """
    mirrored = set(reflect)
    unknown = mirrored - set(shapes)
    if unknown:
        raise ValueError(f"reflect: no shape '{sorted(unknown)[0]}'")
    packed = [_pack(name, shape, name in mirrored) for name, shape in shapes.items()]
    return Model(_apsm.run(packed, _options(options), _threads(threads), _logger(log), progress))


def _paths(paths: Union[Path, Iterable[Path]]) -> "list[str]":
    return [os.fspath(p) for p in ([paths] if isinstance(paths, (str, os.PathLike)) else paths)]


def run_files(inputs: Union[Path, Iterable[Path]], folder: Path, *, parts: Optional[str] = None,
              align_parts: Optional[str] = None, shared_boundary: Optional[str] = None, overwrite: bool = False,
              resume: bool = False, threads: Optional[int] = None, log: Log = None, progress: Progress = None,
              **options: Any) -> None:
    """What `apsm run INPUT... -o FOLDER` does; the same files.

    parts ("tibia=_tibia,talus=_talus") makes one model of several parts a subject, with align_parts and
    shared_boundary as in docs/options.md.
    """
    given = (os.fspath(folder), _paths(inputs), _options(options), _threads(threads), overwrite, resume, _logger(log),
             progress)
    if parts is None:
        _apsm.run_files(*given)
    else:
        _apsm.run_joint(*given, parts, align_parts, shared_boundary)


def add(folder: Path, inputs: Union[Path, Iterable[Path]], *, threads: Optional[int] = None, log: Log = None,
        progress: Progress = None, **options: Any) -> None:
    """New shapes into a finished model, each fitted by itself; the particles of the others stay: `apsm add`."""
    _apsm.change(os.fspath(folder), "add", _paths(inputs), _options(options), _threads(threads), _logger(log), progress)


def exclude(folder: Path, names: Union[str, Iterable[str]], *, threads: Optional[int] = None, log: Log = None,
            progress: Progress = None) -> None:
    """A finished model without some of its shapes: `apsm exclude`."""
    _apsm.change(os.fspath(folder), "exclude", [names] if isinstance(names, str) else list(names), [],
                 _threads(threads), _logger(log), progress)


def load(path: Path) -> FittedModel:
    """The model of a folder that `apsm run` made, or of a file of `apsm export --model`."""
    return FittedModel(path)


def fit_files(model: Path, inputs: Union[Path, Iterable[Path]], folder: Path, *, landmarks: Optional[Path] = None,
              label: str = "", reflect_match: str = "", exclude: str = "", parts: Optional[str] = None,
              hand: str = "auto", extent: str = "auto", aligned: bool = False, force: bool = False,
              overwrite: bool = False, threads: Optional[int] = None, log: Log = None,
              progress: Progress = None) -> "dict[str, list]":
    """What `apsm fit` does with files: surfaces, masks, point files, subjects of a joint.

    Returns the table of results as columns; the folder has particles, meshes and a report.
    """
    out = os.fspath(folder)
    _apsm.fit_files(os.fspath(model), _paths(inputs), out, None if landmarks is None else os.fspath(landmarks), label,
                    reflect_match, exclude, parts, _word("hand", hand, _HANDS), _word("extent", extent, _EXTENTS),
                    aligned, force, overwrite, _threads(threads), _logger(log), progress)
    joint = os.path.join(out, "joint_fit.csv")
    return _columns(joint if os.path.exists(joint) else os.path.join(out, "fit.csv"))


# ---- particles of others ----


def _foreign(shapes: Mapping[str, Any]) -> list:
    return [(name, _in(V, "d"), _in(F, "I")) for name, (V, F) in ((n, _mesh(s)) for n, s in shapes.items())]


def _index(names: "list[str]", template: Optional[str]) -> int:
    if template is not None and template not in names:
        raise ValueError(f"template: no shape {template!r}")
    return 0 if template is None else names.index(template)


def save(folder: Path, shapes: Mapping[str, Any], particles: Any, *, template: Optional[str] = None,
         threads: Optional[int] = None, log: Log = None, progress: Progress = None,
         **options: Any) -> None:
    """A model folder of particles (I, J, 3) and meshes that anyone has made, all in one frame.

    Nothing is groomed or optimised: mean, modes, figures, certificate and report are made.  `apsm import` for arrays.
    """
    _apsm.save(os.fspath(folder), _foreign(shapes), _in(particles, "d"), _index(list(shapes), template),
               _options(options), _threads(threads), _logger(log), progress)


def certify(shapes: Mapping[str, Any], particles: Any, *, template: Optional[str] = None,
            threads: Optional[int] = None, log: Log = None) -> dict:
    """The verdict on anyone's particles (I, J, 3) of meshes in one frame, as the dictionary of certificate.json."""
    with tempfile.TemporaryDirectory() as out:
        path = os.path.join(out, "certificate.json")
        _apsm.certify(_foreign(shapes), _in(particles, "d"), _index(list(shapes), template), path, _threads(threads),
                      _logger(log))
        with open(path, encoding="utf-8") as file:
            return json.load(file)


def import_statismo(path: Path, folder: Path, *, particles: int = 128, threads: Optional[int] = None,
                    log: Log = None, progress: Progress = None) -> bool:
    """A model folder of a model file of Scalismo or Statismo (.h5, .h5.json); whether its shapes are
    the model's own, not drawn from it."""
    shapes, P, J, own = _apsm.read_statismo(os.fspath(path), particles, _logger(log))
    meshes = {name: (_out(V, len(V) // 24, 3), _out(F, len(F) // 12, 3, code="I")) for name, (V, F) in shapes}
    save(folder, meshes, _out(P, len(shapes), J, 3), threads=threads, log=log, progress=progress)
    return own
