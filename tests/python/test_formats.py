"""Two hundred drawn files, read by Kisspoint and by the libraries that are generally used for them: pandas, pyarrow, asammdf.

Each file holds one recording with a drawn length, rate, type, layout and order of columns. Every sample is compared.
"""

import json
import os
import subprocess

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal
from conftest import ROOT, find_command

FILES = 200
UNITS = {"omega_f_rad_s": "rad/s", "omega_c_rad_s": "rad/s", "T_e_Nm": "Nm", "x_to_cmd_mm": "mm", "theta_h_degC": "degC",
         "x_to_mm": "mm", "T_fc_Nm": "Nm", "theta_c_degC": "degC"}  # fmt: skip
ENTRY = {"manoeuvre": "launch", "theta_c0_degC": 36.0, "theta_b0_degC": 30.0}


def example():
    """The example program, beside the command, that prints what was read."""
    built = find_command().parent / "examples" / "read_campaign"
    if not built.is_file():
        profile = os.environ.get("KISSPOINT_PROFILE", "quick")
        subprocess.run(["cargo", "build", "--quiet", "--profile", profile, "--example", "read_campaign"], cwd=ROOT, check=True)
    return built


def drawn(rng):
    """Columns of a recording that passes all plausibility checks: smooth, varying, within the bounds of a car."""
    n, rate = int(rng.integers(120, 900)), float(rng.choice([50.0, 100.0, 250.0, 1000.0]))
    n = max(n, int(1.2 * rate))
    t = np.arange(n) / rate
    rise = 1 / (1 + np.exp(-(t - 0.5 * t[-1]) * 8 / t[-1]))
    noise = lambda size: rng.normal(0, size, n)  # noqa: E731
    top = rng.uniform(90, 200)
    return {
        "time_s": t,
        "omega_f_rad_s": top + 20 * rise + noise(0.3),
        "omega_c_rad_s": (top + 20 * rise) * rise + noise(0.3),
        "T_e_Nm": 90 * np.minimum(t / (0.3 * t[-1]), 1) + noise(0.2),
        "x_to_cmd_mm": 3.0 + 2.2 * np.minimum(t / (0.8 * t[-1]), 1) + noise(0.001),
        "theta_h_degC": 25.0 + 0.5 * rise + noise(0.01),
        "x_to_mm": 3.0 + 2.2 * np.minimum(t / (0.8 * t[-1]), 1) + noise(0.01),
        "T_fc_Nm": 80 * rise + noise(0.5),
        "theta_c_degC": 36 + 20 * rise + noise(0.3),
    }


def write_csv(path, columns, rng):
    frame = pd.DataFrame(columns)
    separator = str(rng.choice([",", ";", "\t"]))
    decimals = [None, "%.6f", "%.9g", "%.12e"][rng.integers(4)]
    frame.to_csv(path, sep=separator, index=False, float_format=decimals, lineterminator=str(rng.choice(["\n", "\r\n"])),
                 encoding=str(rng.choice(["utf-8", "utf-8-sig"])))  # fmt: skip
    read = pd.read_csv(path, sep=separator, encoding="utf-8-sig")
    return {name: read[name].to_numpy(dtype=float) for name in columns}


def write_parquet(path, columns, rng):
    kinds = {name: pa.float64() if name == "time_s" or rng.random() < 0.5 else pa.float32() for name in columns}
    table = pa.table({name: pa.array(values, kinds[name]) for name, values in columns.items()})
    pq.write_table(table, path, compression=str(rng.choice(["none", "snappy", "zstd", "gzip"])), row_group_size=int(rng.integers(40, 2000)),
                   use_dictionary=bool(rng.random() < 0.5), data_page_version=str(rng.choice(["1.0", "2.0"])))  # fmt: skip
    read = pq.read_table(path)
    return {name: read[name].to_numpy().astype(float) for name in columns}


def write_mdf(path, columns, rng):
    t = columns["time_s"]
    kind = {name: np.float64 if rng.random() < 0.5 else np.float32 for name in UNITS}
    mdf = MDF(version=str(rng.choice(["4.10", "4.11", "4.20"])))
    signals = [Signal(columns[name].astype(kind[name]), t, name=name, unit=unit) for name, unit in UNITS.items()]
    cut = int(rng.integers(1, len(signals)))
    for group in [signals] if rng.random() < 0.5 else [signals[:cut], signals[cut:]]:
        mdf.append(group, common_timebase=True)
    saved = mdf.save(path, overwrite=True, compression=int(rng.integers(3)))
    mdf.close()
    with MDF(saved) as back:
        read = {name: back.get(name, raw=True).samples.astype(float) for name in UNITS}
    return {"time_s": t, **read}


WRITERS = {"csv": write_csv, "parquet": write_parquet, "mf4": write_mdf}


@pytest.mark.parametrize("ending", WRITERS)
def test_every_sample_is_what_the_others_read(ending, tmp_path):
    rng = np.random.default_rng([20261122, list(WRITERS).index(ending)])
    expected = {}
    for k in range(FILES // len(WRITERS) + 1):
        columns = drawn(rng)
        names = list(columns)
        rng.shuffle(names)
        name = f"r{k:03}"
        expected[name] = WRITERS[ending](tmp_path / f"{name}.{ending}", {n: columns[n] for n in names}, rng)
    (tmp_path / "vehicle.json").write_text("{}")
    (tmp_path / "recordings.json").write_text(json.dumps({name: ENTRY for name in expected}))
    done = subprocess.run([example(), tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    read = json.loads(done.stdout)
    assert read["left_out"] == []
    assert set(read["recordings"]) == set(expected)
    for name, columns in expected.items():
        for channel, theirs in columns.items():
            ours = np.array(read["recordings"][name][channel], dtype=float)
            if channel == "time_s":
                theirs = theirs - theirs[0]
            assert ours.shape == theirs.shape, f"{name} {channel}"
            tolerance = 1e-9 if channel == "time_s" else 0.0
            assert np.abs(ours - theirs).max() <= tolerance, f"{name}.{ending} {channel}"
