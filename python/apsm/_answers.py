"""From a model folder to answers and to other programs; every function returns what the files of the program hold."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from typing import Any, Iterable, Iterator, Mapping, Optional, Union

from ._core import Array, Log, Path, Table, _apsm, _columns, _in, _logger, _out, _subjects, _threads

Subjects = Union[Path, Table, None]

_NONE = (1 << 64) - 1  # bootstraps


def _files(paths: Union[Path, Iterable[Path]]) -> "list[str]":
    return [os.fspath(p) for p in ([paths] if isinstance(paths, (str, os.PathLike)) else paths)]


@contextlib.contextmanager
def _results(out: Optional[Path]) -> Iterator[str]:
    """The folder of results: the one given, which stays, or one that goes."""
    if out is not None:
        os.makedirs(out, exist_ok=True)
        yield os.fspath(out)
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield folder


def _read(folder: str, name: str) -> dict:
    with open(os.path.join(folder, name), encoding="utf-8") as file:
        return json.load(file)


def _of_format(folder: str, word: str) -> "list[dict]":
    """The JSON files of a format, in the order of their names."""
    found = [_read(folder, name) for name in sorted(os.listdir(folder)) if name.endswith(".json")]
    return [one for one in found if one.get("format") == word]


# ---- statistics ----


def test(folder: Path, formula: str, *, of: Optional[str] = None, on: str = "form", subjects: Subjects = None,
         within: Optional[str] = None, permutations: int = 10000, bootstraps: int = 1000, variances: str = "equal",
         stop_risk: float = 0, seed: int = 0, threads: Optional[int] = None, log: Log = None) -> dict:
    """What `apsm test` finds, as the dictionary of its JSON file (docs/formats.md).

    subjects: a .csv or .tsv, or columns by name, also of pandas; the column "name" names the shapes.
    on: "form", "shape", "size" or "modes".  Ctrl-C ends it.
    """
    if variances not in ("equal", "unequal"):
        raise ValueError(f"variances: equal or unequal, not {variances!r}")
    with _results(None) as where, _subjects(subjects) as table:
        _apsm.test(os.fspath(folder), formula, of, on, table, within, where, permutations, bootstraps or _NONE, seed,
                   variances == "unequal", float(stop_risk), _threads(threads), _logger(log))
        return _of_format(where, "apsm-test")[0]


def asymmetry(folder: Path, *, of: str, within: str, on: str = "form", subjects: Subjects = None,
              permutations: int = 10000, seed: int = 0, threads: Optional[int] = None, log: Log = None) -> dict:
    """What `apsm asymmetry` finds: the dictionary of asymmetry_ON.json, with its tests as "directional" and, where
    sides were measured repeatedly, "fluctuating".  of: the column of the sides; within: of the subjects."""
    with _results(None) as where, _subjects(subjects) as table:
        _apsm.test(os.fspath(folder), None, of, on, table, within, where, permutations, _NONE, seed, False, 0.0,
                   _threads(threads), _logger(log))
        result = _of_format(where, "apsm-asymmetry")[0]
        for other in _of_format(where, "apsm-test"):
            result[other["title"].split()[0].lower()] = other
        return result


def _answer(kind: str, folder: Path, what: Optional[str], files: "list[str]", table: Optional[str],
            more: Optional[str], where: str, aligned: bool, seed: int, threads: Optional[int], log: Log) -> None:
    _apsm.answer(kind, os.fspath(folder), what, files, table, more, where, aligned, seed, _threads(threads), _logger(log))


def measure(folder: Path, definition: Union[Path, Mapping[str, Any]], *, files: Union[Path, Iterable[Path]] = (),
            subjects: Subjects = None, out: Optional[Path] = None, threads: Optional[int] = None,
            log: Log = None) -> "dict[str, list]":
    """Distances, angles, diameters, areas, volumes, defined once on the template, of every shape, as columns.

    definition: a .json, or what it holds.  files: more shapes, particles or folders of fits; then their table.
    """
    with _results(out) as where, _subjects(subjects) as table, tempfile.TemporaryDirectory() as scratch:
        if isinstance(definition, Mapping):
            path = os.path.join(scratch, "definition.json")
            with open(path, "w", encoding="utf-8") as file:
                json.dump(definition, file)
            definition = path
        given = _files(files)
        _answer("measure", folder, os.fspath(definition), given, table, None, where, False, 0, threads, log)
        return _columns(os.path.join(where, "measurements_files.csv" if given else "measurements.csv"))


def norm(folder: Path, files: Union[Path, Iterable[Path]], *, formula: Optional[str] = None, subjects: Subjects = None,
         seed: int = 0, out: Optional[Path] = None, threads: Optional[int] = None, log: Log = None) -> dict:
    """How unusual new shapes are among the model's, as the dictionary of norm.json.

    files: particles, or folders of fits.  out: keeps all results there, with the page norm.html.
    """
    with _results(out) as where, _subjects(subjects) as table:
        _answer("norm", folder, formula, _files(files), table, None, where, False, seed, threads, log)
        return _read(where, "norm.json")


def predict(folder: Path, of: str, *, subjects: Subjects = None, files: Union[Path, Iterable[Path]] = (),
            at: Iterable[float] = (), seed: int = 0, out: Optional[Path] = None, threads: Optional[int] = None,
            log: Log = None) -> dict:
    """A column of numbers or of two groups from the shape, cross-validated; of new shapes too, with an interval.

    at: values for which the shape to be expected is written as a .ply; give out to keep it.
    """
    values = ",".join(repr(float(x)) for x in at) or None
    with _results(out) as where, _subjects(subjects) as table:
        _answer("predict", folder, of, _files(files), table, values, where, False, seed, threads, log)
        return _of_format(where, "apsm-prediction")[0]


def landmarks(folder: Path, file: Path, *, aligned: bool = False, out: Optional[Path] = None,
              threads: Optional[int] = None, log: Log = None) -> "dict[str, list]":
    """Named points placed once (.mrk.json, .fcsv, .csv), on every shape: the columns of landmarks.csv."""
    with _results(out) as where:
        _answer("landmarks", folder, os.fspath(file), [], None, None, where, aligned, 0, threads, log)
        return _columns(os.path.join(where, "landmarks.csv"))


def compare(a: Path, b: Path, *, threads: Optional[int] = None, log: Log = None) -> dict:
    """The same anatomy in two models, as the dictionary of compare.json."""
    with tempfile.TemporaryDirectory() as out:
        where = os.path.join(out, "compare")
        _apsm.compare(os.fspath(a), os.fspath(b), where, _threads(threads), _logger(log))
        return _read(where, "compare.json")


# ---- folders ----


def verify(folder: Path, *, threads: Optional[int] = None) -> "list[str]":
    """Lines that say where a model folder or its inputs are no longer what they were; empty if they are."""
    return _apsm.verify(os.fspath(folder), _threads(threads))


def report(folder: Path, *, threads: Optional[int] = None, log: Log = None) -> str:
    """Writes the page of a model folder anew; its path."""
    _apsm.report(os.fspath(folder), _threads(threads), _logger(log))
    return os.path.join(os.fspath(folder), "report.html")


# ---- other programs ----


def export(folder: Path, to: str, out: Path, *, modes: int = 0, sd: Iterable[float] = (), overwrite: bool = False,
           log: Log = None) -> None:
    """What `apsm export --to` writes: "vtp", "ply", "gltf", "monai", "slicermorph", "csv", "npz", ..."""
    _apsm.export(os.fspath(folder), to, os.fspath(out), modes, _in(list(sd), "d"), overwrite, _logger(log))


def warp(from_particles: Any, particles: Any, points: Any) -> Array:
    """Points (n, 3) on, in or near a template, as the warp carries them that takes its particles (J, 3) to those of
    a shape (J, 3), or of several (I, J, 3)."""
    P0, P, X = _in(from_particles, "d"), _in(particles, "d"), _in(points, "d")
    size = [len(memoryview(a).cast("B")) // 24 for a in (P0, P, X)]
    data = _apsm.warp(P0, P, X)
    several = size[1] != size[0]
    return _out(data, size[1] // size[0], size[2], 3) if several else _out(data, size[2], 3)
