"""Builds the command and the FMUs' shared library with cargo, and puts both into the Python package.

$KISSPOINT and $KISSPOINT_LIBRARY name a command and a library that are built already; then cargo is not called. In place of the library,
$KISSPOINT_LIBRARIES names a folder of libraries by platform, which all go in; $KISSPOINT_PLATFORM is the platform that the wheel is for, this one
unless set. packaging/release.sh sets them.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
PLATFORM = os.environ.get("KISSPOINT_PLATFORM")
WINDOWS = (PLATFORM or sys.platform).startswith("win")
COMMAND, LIBRARY = ("kisspoint.exe", "kisspoint.dll") if WINDOWS else ("kisspoint", "libkisspoint.so")


class WithCargo(build_py):
    def run(self):
        super().run()
        command, library, libraries = (os.environ.get(name) for name in ("KISSPOINT", "KISSPOINT_LIBRARY", "KISSPOINT_LIBRARIES"))
        if not (command and (library or libraries)):
            for what in (["--profile", "quick", "--bin", "kisspoint"], ["--release", "--lib", "--no-default-features"]):
                subprocess.run(["cargo", "build", *what], cwd=ROOT, check=True)
            command, library = TARGET / "quick" / COMMAND, TARGET / "release" / LIBRARY
        package = Path(self.build_lib) / "kisspoint"
        shutil.copy2(command, package / COMMAND)
        if libraries:
            shutil.copytree(libraries, package / "libraries", dirs_exist_ok=True)
        else:
            shutil.copy2(library, package / LIBRARY)


class ForThisPlatform(bdist_wheel):
    """The wheel holds programs of one platform, but suits every Python."""

    def get_tag(self):
        return "py3", "none", PLATFORM or super().get_tag()[2]


class Binary(Distribution):
    def has_ext_modules(self):
        return True


setup(distclass=Binary, cmdclass={"build_py": WithCargo, "bdist_wheel": ForThisPlatform})
