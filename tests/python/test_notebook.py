"""The notebook of the documentation, executed again: it runs, it prints what it printed before, and it names nothing of the machine that ran it.

    python tests/python/test_notebook.py     executes it and writes what it printed into it
"""

import os
import re
import sys
from pathlib import Path

import nbformat
from conftest import ROOT, find_command
from nbclient import NotebookClient

NOTEBOOK = ROOT / "docs/from-recordings-to-fmu.ipynb"


def executed():
    """The notebook with fresh outputs, executed with this checkout's package and the command that the tests use."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    paths = os.pathsep.join([str(ROOT / "python"), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "KISSPOINT": str(find_command()), "PYTHONPATH": paths}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(ROOT)}}).execute(env=environment)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
    return notebook


def printed(notebook):
    """Texts that the cells print, without tables and pictures."""
    return ["".join(o.text for o in cell.outputs if o.output_type == "stream") for cell in notebook.cells if cell.cell_type == "code"]


def verdict(notebook):
    (cell,) = (c for c in notebook.cells if "verdict" in c.metadata.get("tags", []))
    return "".join(output.text for output in cell.outputs)


def test_it_runs_and_says_what_it_said():
    kept, fresh = nbformat.read(NOTEBOOK, as_version=4), executed()
    # The closed share of the gap may change in its last digits with the method; the words may not.
    words = lambda notebook: re.sub(r"[\d.]+ %", "… %", verdict(notebook))
    assert words(fresh) == words(kept), "execute it again: python tests/python/test_notebook.py"
    assert "explained by kiss_point_thermal" in verdict(fresh)
    by_fmpy = next(text for text in printed(fresh) if "by FMPy" in text)
    for line in by_fmpy.splitlines():
        found, stated = float(line.split()[1]), float(line.split()[-2])
        assert abs(found - stated) <= 0.01 * stated + 0.001, line


def test_its_outputs_name_nothing_of_a_machine():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs) and not any(o.output_type == "error" for o in outputs)
    assert not any(o.output_type == "stream" and o.name == "stderr" for o in outputs), "a warning stands in it"
    texts = [str(output.get("text", "")) + str({k: v for k, v in output.get("data", {}).items() if k != "image/png"}) for output in outputs]
    for folder in {Path.home(), ROOT, Path(sys.prefix), Path("/tmp"), Path("/usr")}:
        assert not any(f"{folder}/" in text for text in texts), folder
    assert NOTEBOOK.stat().st_size < 400_000


if __name__ == "__main__":
    nbformat.write(executed(), NOTEBOOK)
