"""What the other files of the package share: the library, its errors, arrays in and out."""

from __future__ import annotations

import array
import contextlib
import csv
import os
import sys
import tempfile
import warnings
from typing import Any, Callable, Iterator, Mapping, Optional, Union

Path = Union[str, "os.PathLike[str]"]
Log = Optional[Callable[[str], None]]
Progress = Optional[Callable[[str, int, int], None]]
Array = Any  # a NumPy array, or a memoryview of the same shape
Table = Mapping[str, Any]  # columns by their names; a pandas.DataFrame is one


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
        from . import _apsm  # it looks for Error in the package
    finally:
        if pins:
            del os.environ[name]
    return _apsm


_apsm = _pinned_kernels()

try:
    import numpy as _np
except ImportError:  # everything works without
    _np = None


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
            depth, frame = 1, sys._getframe(0)
            while frame.f_back and os.path.dirname(frame.f_code.co_filename) == os.path.dirname(__file__):
                depth, frame = depth + 1, frame.f_back
            warnings.warn(line, stacklevel=depth)  # where the user's call stands

    return warn


def _threads(threads: Optional[int]) -> int:
    return threads if threads else os.cpu_count() or 1


@contextlib.contextmanager
def _subjects(table: Union[Path, Table, None]) -> Iterator[Optional[str]]:
    """The path of a table: a file, or columns (also of pandas), of which the first, or "name", names the shapes."""
    if table is None or isinstance(table, (str, os.PathLike)):
        yield None if table is None else os.fspath(table)
        return
    names = list(table)
    if "name" in names:
        names.insert(0, names.pop(names.index("name")))
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "subjects.csv")
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(names)
            writer.writerows(zip(*(["" if _missing(v) else v for v in table[name]] for name in names)))
        yield path


def _missing(value: Any) -> bool:
    return value is None or value != value  # NaN, NaT


def _columns(path: str) -> "dict[str, list]":
    """A .csv as columns, numbers as numbers."""
    def read(text: str) -> Any:
        try:
            return float(text)
        except ValueError:
            return text

    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    return {name: [read(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}
