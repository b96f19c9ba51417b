"""Every linked crate has a licence that deny.toml allows and that packaging/licenses lists."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "packaging" / "licences.py"


def test_licences_are_allowed_and_listed():
    done = subprocess.run([sys.executable, SCRIPT, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_expressions_are_read_as_spdx_means_them(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPT.parent)
    from licences import offers

    assert offers("MIT OR Apache-2.0", {"MIT"}) and offers("Unlicense/MIT", {"MIT"})
    assert not offers("MIT AND GPL-3.0", {"MIT"}) and offers("(MIT OR GPL-3.0) AND Zlib", {"MIT", "Zlib"})
    assert not offers("Apache-2.0 WITH LLVM-exception", {"Apache-2.0"}) and not offers("none", {"MIT"})
