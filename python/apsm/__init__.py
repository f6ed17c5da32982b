"""apsm: statistical shape models from meshes and segmentations.

    import apsm
    model = apsm.run({"a": (vertices, faces), ...}, particles=128)
    model.mean, model.modes, model.variances, model.scores
    model.fit(vertices, faces), model.test("~ group", subjects=table), model.warp(particles), model.save("folder")
    apsm.load("folder")            # the same of a model folder that the program has made

Arrays come in as anything with a buffer or as nested sequences.  They go out as NumPy arrays where
NumPy is installed, else as memoryviews of the same shape, which index, slice and tolist() alike.
Shapes may also be objects with .vertices and .faces (trimesh), .points and .regular_faces or .faces
(PyVista), or images with .get_fdata() and .affine (nibabel).
"""

from ._answers import asymmetry, compare, export, landmarks, measure, norm, predict, report, test, verify, warp
from ._core import Error, Volume
from ._models import (Fit, FittedModel, Model, add, certify, exclude, fit_files, import_statismo, load, run, run_files,
                      save)

__all__ = ["Error", "Fit", "FittedModel", "Model", "Volume", "add", "asymmetry", "certify", "compare", "exclude",
           "export", "fit_files", "import_statismo", "landmarks", "load", "measure", "norm", "predict", "report",
           "run", "run_files", "save", "test", "verify", "warp"]
