"""Quotations in the documentation agree with the program: the integrator's first curve, the counts of README.md.

    python tests/python/test_quoted.py     writes the integrator's numbers into docs/importers.md; packaging/docs.sh makes the rest
"""

import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from conftest import ROOT, find_command
from master import Model

IMPORTERS = ROOT / "docs/importers.md"
FIRST_CURVE = re.compile(r"at 1\.3 s `omega_f` = ([\d.]+) rad/s, `omega_c` = ([\d.]+) rad/s, `theta_c` = ([\d.]+) °C")


def first_curve(fmu):
    """The numbers of the page's table: the plant alone, with inputs held from the start, after 1.3 s in steps of 1 ms."""
    plant = Model(fmu).instance(x_to=6.0, T_e_ref=45.0)
    for _ in range(1300):
        plant.step(1e-3)
    found = plant.get("omega_f", "omega_c", "theta_c")
    assert plant.get("phase_code") == 2
    plant.free()
    return tuple(f"{value:.3f}" for value in found)


def test_the_integrator_s_first_curve_is_as_the_page_says(fmus):
    assert FIRST_CURVE.search(IMPORTERS.read_text(encoding="utf-8")).groups() == first_curve(fmus["DrivelinePlant"]), "packaging/docs.sh writes it anew"


BOUND = re.compile(r"\|[^|]*?\b(\d+) of (\d+)\b[^|\n]*\| at (most|least) ([\d.]+) %")
VALIDATION = ROOT / "docs/validation.md"


def test_the_counts_of_the_readme_are_those_of_the_validation():
    """Each "n of m" in it occurs in the tables of the validation page."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (said,) = re.findall(r"## How often it is right\n(.*?)\n## ", readme, re.S)
    validation = VALIDATION.read_text(encoding="utf-8")
    counts = re.findall(r"[\d.]+ of \d+", said)
    assert len(counts) >= 4 and not [count for count in counts if not re.search(rf"\b{re.escape(count)}\b", validation)]
    ((cars, flaws),) = re.findall(r"\| (\d+) new cars, bench .*?wrong claims .*? bench, ([^:]*):", said, re.S)
    claims = re.search(r"claims of 95 % and more that were true \| (\d+) of (\d+) \|", validation)
    assert re.search(rf"cars given an effect too many \| \d+ of {cars} \|", validation)
    assert sum(map(int, re.findall(r"\d+", flaws))) == int(claims[2]) - int(claims[1])


@pytest.mark.parametrize("page", [ROOT / "README.md", VALIDATION])
def test_bounds_follow_from_their_counts(page):
    """A bound is the share at which so few, or so many, hits would be found once in twenty times; it is rounded away from the observed share."""

    def at_most(found, all_):
        low, high = found / all_, 1.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            tail = sum(math.comb(all_, k) * middle**k * (1 - middle) ** (all_ - k) for k in range(found + 1))
            low, high = (middle, high) if tail > 0.05 else (low, middle)
        return high

    rows = BOUND.findall(page.read_text(encoding="utf-8"))
    assert len(rows) >= 5
    for found, all_, side, said in rows:
        found, all_, said = int(found), int(all_), float(said)
        bound = 100 * (at_most(found, all_) if side == "most" else 1 - at_most(all_ - found, all_))
        assert said == (math.ceil(bound) if side == "most" else math.floor(bound)), f"{found} of {all_}: {bound:.2f} %"


def words(head):
    """The words of the header with all numbers masked, because their last digits change with the compiler."""
    return re.sub(r"\d[\d.]*", "…", " ".join(re.sub(r"<[^>]*>", " ", head).split()))


def main():
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([find_command(), "fmu", "--out", folder], check=True, capture_output=True)
        omega_f, omega_c, theta_c = first_curve(Path(folder) / "DrivelinePlant.fmu")
    text = f"at 1.3 s `omega_f` = {omega_f} rad/s, `omega_c` = {omega_c} rad/s, `theta_c` = {theta_c} °C"
    page, count = FIRST_CURVE.subn(text, IMPORTERS.read_text(encoding="utf-8"))
    assert count == 1
    IMPORTERS.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
