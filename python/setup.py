"""Builds the module against an installed libapsm, which pkg-config finds:  pip install ./python"""
import shlex
import subprocess

from setuptools import Extension, setup


def flags(what):
    return shlex.split(subprocess.check_output(["pkg-config", what, "apsm"], text=True))


libdir = subprocess.check_output(["pkg-config", "--variable=libdir", "apsm"], text=True).strip()
setup(
    name="apsm",
    version="0.1.0",
    description="statistical shape models from meshes and segmentations",
    license="Apache-2.0",
    packages=["apsm"],
    package_data={"apsm": ["py.typed"]},
    python_requires=">=3.11",
    ext_modules=[
        Extension("apsm._apsm", ["_apsm.c", "_call.c", "_folders.c"], extra_compile_args=["-std=c17", *flags("--cflags")],
                  extra_link_args=[*flags("--libs"), f"-Wl,-rpath,{libdir}"], py_limited_api=True)
    ],
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
)
