"""The Python package: a campaign, its answer, the retuned plant; recordings in memory are in the notebook."""

import json
import math
import os
import re
import shutil
import subprocess
import sys

import pytest
from conftest import ROOT, find_command

sys.path.insert(0, str(ROOT / "python"))
os.environ.setdefault("KISSPOINT", str(find_command()))

import kisspoint  # noqa: E402

EXAMPLE = ROOT / "tests/data/campaigns/example"


@pytest.fixture(scope="module")
def found():
    return kisspoint.diagnose(EXAMPLE)


def rms(a, b):
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True)) / len(a))


def test_the_answer_reads_like_a_mapping_and_by_name(found):
    assert found["verdict"] == found.verdict == "explained"
    assert found.effects == ["kiss_point_thermal"]
    assert 0 < found.confidence <= 1 and found.sentence in repr(found)
    assert found.report.stat().st_size < 1_500_000


def test_a_replay_of_the_held_out_recording_gives_the_numbers_of_the_answer(found):
    far = found["how_far"]
    runs = found.replay(far["held_out"][0])
    for row in far["per_recording"]:
        if row["channel"] in runs["real"]:
            for name in ("before", "after"):
                assert rms(runs["real"][row["channel"]], runs[name][row["channel"]]) == pytest.approx(row[name], rel=0.01)


def test_a_figure_has_both_speeds(found):
    axes = found.figure("r05").axes
    assert [len(a.lines) for a in axes] == [3, 3] and "rad/s" in axes[0].get_ylabel()


def test_gaps_parameters_and_files_are_told(found):
    rows = kisspoint.gap(EXAMPLE)
    assert len(rows) == 18 and all(row["rms"] > row["noise"] > 0 for row in rows if row["recording"] == "r05")
    assert {row["parameter"] for row in found.parameters} == {"slope", "curvature", "closed_share"}
    assert all(row["low"] <= row["value"] <= row["high"] for row in found.parameters)
    assert [c["guess"] for c in kisspoint.inspect(EXAMPLE / "r01.csv")["channels"]][:2] == ["time_s", "omega_f_rad_s"]


def test_curves_come_from_any_file_and_any_channel_that_the_command_reads(tmp_path):
    """MF4 and Parquet alternately, with the engine speed in rpm under a logger's name."""
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    asammdf = pytest.importorskip("asammdf")
    source = tmp_path / "campaign"
    shutil.copytree(EXAMPLE, source)
    for k, file in enumerate(sorted(source.glob("r*.csv"))):
        table = pandas.read_csv(file).rename(columns={"omega_f_rad_s": "nEngine"})
        table["nEngine"] *= 30 / math.pi
        if k % 2:
            table.to_parquet(file.with_suffix(".parquet"))
        else:
            time = table.pop("time_s").to_numpy()
            signals = [asammdf.Signal(table[name].to_numpy(), time, name=name) for name in table]
            with asammdf.MDF() as measurement:
                measurement.append(signals)
                measurement.save(file.with_suffix(".mf4"))
        file.unlink()
    channels = tmp_path / "channels.toml"
    channels.write_text('[omega_f_rad_s]\nname = "nEngine"\nunit = "rpm"\n')
    found = kisspoint.diagnose(source, channel_map=channels)
    assert found.effects == ["kiss_point_thermal"]
    assert found.recordings == [f"r{k:02}" for k in range(1, 10)]
    assert all(len(found.figure(name).axes) == 2 for name in ("r01", "r02"))
    with pytest.raises(KeyError, match="r01"):
        found.replay("no such recording")


def tables():
    pandas = pytest.importorskip("pandas")
    made = {file.stem: pandas.read_csv(file) for file in sorted(EXAMPLE.glob("r*.csv"))[:2]}
    about = json.loads((EXAMPLE / "recordings.json").read_text())
    return made, {name: about[name] for name in made}, EXAMPLE / "vehicle.json"


def test_gaps_of_tables_in_memory_have_the_notes(found):
    made, about, vehicle = tables()
    rows = kisspoint.gap(made, about=about, vehicle=vehicle)
    assert {row["recording"] for row in rows} == set(made)
    assert rows.notes == [] or {"recording", "text"} <= set(rows.notes[0])
    assert rows.left_out == []
    folder = {(row["recording"], row["channel"]): row["rms"] for row in kisspoint.gap(EXAMPLE)}
    assert all(row["rms"] == pytest.approx(folder[row["recording"], row["channel"]]) for row in rows)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p, t: t.drop(columns="time_s").set_index(p.to_datetime(t["time_s"], unit="s")), "r01: the time is in the index .DatetimeIndex"),
        (lambda p, t: t.set_index("time_s"), "r01: the time is in the index .*reset_index"),
        (lambda p, t: t.assign(time_s=p.to_datetime(t["time_s"], unit="s")), "r01, column time_s, row 0: Timestamp"),
        (lambda p, t: t.assign(T_e_Nm=t["T_e_Nm"].astype(str)), "r01, column T_e_Nm, row 0: .* but text"),
        (lambda p, t: t.assign(T_e_Nm=[[1]] * len(t)), r"r01, column T_e_Nm, row 0: \[1\] is not a number"),
    ],
)
def test_what_is_no_number_is_named_with_recording_and_column(change, said):
    pandas = pytest.importorskip("pandas")
    made, about, vehicle = tables()
    made["r01"] = change(pandas, made["r01"])
    with pytest.raises(ValueError, match=said):
        kisspoint.gap(made, about=about, vehicle=vehicle)


def test_a_missing_value_is_a_gap_whatever_its_type():
    from kisspoint._campaign import _cell

    pandas = pytest.importorskip("pandas")
    assert [_cell("r", "c", 0, v) for v in (None, math.nan, pandas.NA, pandas.NaT, 1)] == ["", "", "", "", "1.0"]


def test_it_is_typed():
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_a_plant_is_stepped_and_named_variables_are_checked(found):
    with found.load_plant(theta_c_start=120.0) as plant:
        plant.step(1e-3, x_to=6.5, T_e_ref=40.0)
        assert plant.get("theta_c") == pytest.approx(120.0, abs=1.0) and plant.get("phase") == 2
        with pytest.raises(KeyError, match="no_such"):
            plant.get("no_such")


def test_it_installs_into_a_fresh_environment_and_needs_nothing_else(tmp_path):
    """Wheel and environment are made offline; the command and the library are those of this build, which setup.py accepts through variables."""
    source = tmp_path / "source"
    shutil.copytree(ROOT / "python", source / "python", ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE-MIT", "LICENSE-APACHE"):
        shutil.copy(ROOT / name, source)
    # Without the variables that this session sets, because the package must find its own command and library.
    bare = {name: value for name, value in os.environ.items() if not name.startswith(("KISSPOINT", "PYTHON"))}
    built = {**bare, "KISSPOINT": str(find_command()), "KISSPOINT_LIBRARY": str(find_command().with_name("libkisspoint.so"))}
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path, source], env=built, check=True)
    (wheel,) = tmp_path.glob("kisspoint-*-py3-none-*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "fresh"], check=True)
    python = tmp_path / "fresh/bin/python"
    subprocess.run([*pip, "--python", python, "install", "--no-deps", "--no-index", wheel], env=bare, check=True)
    asked = f"import kisspoint; print(kisspoint.__version__, kisspoint.diagnose({str(EXAMPLE)!r}).verdict)"
    said = subprocess.run([python, "-c", asked], env=bare, cwd=tmp_path, check=True, stdout=subprocess.PIPE, text=True).stdout
    version = re.search(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text(encoding="utf-8"), re.M)[1]
    assert said.split() == [version, "explained"]
    command = subprocess.run([tmp_path / "fresh/bin/kisspoint", "--version"], env=bare, check=True, capture_output=True, text=True).stdout
    assert command.split() == ["kisspoint", version]


def test_refusals_say_what_is_wrong(tmp_path):
    with pytest.raises(kisspoint.KisspointError, match="vehicle.json"):
        kisspoint.diagnose(tmp_path)
    with pytest.raises(ValueError, match="about"):
        kisspoint.diagnose({"r01": {"time_s": [0.0]}})
    with pytest.raises(ValueError, match="r02"):
        kisspoint.diagnose({"r01": {"time_s": [0.0]}}, about={"r02": {}}, vehicle={})
