"""The command `kisspoint` as this package runs it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path


class KisspointError(RuntimeError):
    """The command's error message, which says which input is wrong and what to do."""


def path() -> Path:
    """Path of the command: $KISSPOINT, the command in this package, or the one on the path."""
    if "KISSPOINT" in os.environ:
        return Path(os.environ["KISSPOINT"])
    own = Path(__file__).with_name("kisspoint.exe" if sys.platform == "win32" else "kisspoint")
    found = own if own.is_file() else shutil.which("kisspoint")
    if not found:
        raise KisspointError("the command kisspoint was not found: install this package with pip, or set KISSPOINT to the command")
    return Path(found)


def run(*arguments: object) -> str:
    """Runs the command and returns its output."""
    done = subprocess.run([str(path()), *map(str, arguments)], capture_output=True, encoding="utf-8")
    if done.returncode != 0:
        raise KisspointError(done.stderr.strip().removeprefix("kisspoint: "))
    return done.stdout


def main() -> int:
    """Passes the command line on to the command, except for `kisspoint fleet`, which this package runs itself."""
    if sys.argv[1:2] == ["fleet"]:
        try:
            from .fleet.__main__ import main as fleet
        except ModuleNotFoundError as error:
            print(f"kisspoint: {error}", file=sys.stderr)
            return 1
        return fleet(sys.argv[2:])
    return subprocess.run([str(path()), *sys.argv[1:]]).returncode
