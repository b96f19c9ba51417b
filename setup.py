"""Builds the command and the FMUs' shared library with cargo, and puts both into the Python package.

$KISSPOINT and $KISSPOINT_LIBRARY name a command and a library that are built already; then cargo is not called. $KISSPOINT_LIBRARIES names a
folder of libraries by platform, which all go in, and $KISSPOINT_PLATFORM the platform that the wheel is for (packaging/release.sh sets them).
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
COMMAND, LIBRARY = ("kisspoint.exe", "kisspoint.dll") if sys.platform == "win32" else ("kisspoint", "libkisspoint.so")


class WithCargo(build_py):
    def run(self):
        super().run()
        command, library = (os.environ.get(name) for name in ("KISSPOINT", "KISSPOINT_LIBRARY"))
        if not (command and library):
            for what in (["--profile", "quick", "--bin", "kisspoint"], ["--release", "--lib", "--no-default-features"]):
                subprocess.run(["cargo", "build", *what], cwd=ROOT, check=True)
            command, library = TARGET / "quick" / COMMAND, TARGET / "release" / LIBRARY
        package = Path(self.build_lib) / "kisspoint"
        shutil.copy2(command, package / COMMAND)
        shutil.copy2(library, package / LIBRARY)
        if libraries := os.environ.get("KISSPOINT_LIBRARIES"):
            shutil.copytree(libraries, package / "libraries", dirs_exist_ok=True)


class ForThisPlatform(bdist_wheel):
    """The wheel holds programs of one platform, but suits every Python."""

    def get_tag(self):
        return "py3", "none", os.environ.get("KISSPOINT_PLATFORM") or super().get_tag()[2]


class Binary(Distribution):
    def has_ext_modules(self):
        return True


setup(distclass=Binary, cmdclass={"build_py": WithCargo, "bdist_wheel": ForThisPlatform})
