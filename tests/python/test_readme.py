"""README.md is correct: its Python code runs, and its commands exist."""

import os
import re
import shlex

import pytest
from conftest import ROOT, find_command

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.S)


def test_its_python_runs(written, monkeypatch):
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(str(ROOT / "python"))
    monkeypatch.setitem(os.environ, "KISSPOINT", str(find_command()))
    names = {}
    for block in blocks("python"):
        exec(block.replace('"out/', f'"{written}/'), names)
    result = names["result"]
    assert result["time"][-1] == pytest.approx(2.0) and result["omega_c"][-1] > 0.0
    assert names["found"].verdict == "explained"


def test_its_commands_exist(kisspoint):
    """Every `kisspoint …` in it is accepted, options included; their function is tested elsewhere."""
    said = {" ".join(line.split("#")[0].split()) for line in README.splitlines() if line.startswith("kisspoint ")}
    said |= set(re.findall(r"`(kisspoint [^`]*)`", README))
    assert len(said) > 8
    for command in sorted(said):
        words = shlex.split(command)[1:]
        names = [word for word in words[:2] if re.fullmatch("[a-z]+", word)]
        names = names if names[:1] == ["vehicle"] else names[:1]
        usage = kisspoint(*names, "--help", check=False)
        assert usage.returncode == 0, f"{command}: {usage.stderr}"
        missing = [word for word in words if word.startswith("--") and word not in usage.stdout]
        assert not missing, f"{command}: {missing}"
