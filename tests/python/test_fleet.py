"""Fleets: rows, cache, resumption, engines, stores. A diagnosis takes about a second, and a campaign of few recordings is used where any campaign will do."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from hashlib import sha256

import pytest
from conftest import ROOT, find_command

sys.path.insert(0, str(ROOT / "python"))
os.environ.setdefault("KISSPOINT", str(find_command()))
# Small matrices do not benefit from threads.
os.environ.setdefault("OMP_NUM_THREADS", "1")

pytest.importorskip("fsspec")
pytest.importorskip("scipy")
from kisspoint import fleet  # noqa: E402
from kisspoint.fleet import __main__ as command_line  # noqa: E402
from kisspoint.fleet import _store, _task  # noqa: E402

EXAMPLE = ROOT / "tests/data/campaigns/example"
KEPT = ("r01", "r04")


def campaign(folder, comment="", about=None):
    """Two recordings of the bundled campaign; a comment makes its bytes different."""
    folder.mkdir(parents=True)
    vehicle = json.loads((EXAMPLE / "vehicle.json").read_text())
    (folder / "vehicle.json").write_text(json.dumps({"_": comment, **vehicle}))
    known = json.loads((EXAMPLE / "recordings.json").read_text())
    (folder / "recordings.json").write_text(json.dumps({name: known[name] for name in KEPT}))
    for name in KEPT:
        shutil.copy(EXAMPLE / f"{name}.csv", folder)
    if about:
        (folder / "car.json").write_text(json.dumps(about))
    return folder


@pytest.fixture(scope="module")
def cars(tmp_path_factory):
    """Two sound campaigns, one that cannot be diagnosed, and an empty folder."""
    root = tmp_path_factory.mktemp("cars")
    campaign(root / "car_1", about={"car": "A1", "mileage_km": 1200, "date": "2026-03-01"})
    campaign(root / "car_2", "other")
    broken = campaign(root / "car_3", "broken")
    (broken / "vehicle.json").write_text("{")
    (root / "car_4").mkdir()
    return root


@pytest.fixture(scope="module")
def first(cars, tmp_path_factory):
    """A run without any cache, with its folder and its cache."""
    out = tmp_path_factory.mktemp("out")
    return fleet.diagnose(f"{cars}/*", out=out / "fleet.parquet"), out


def test_rows_hold_answers_and_errors(first, cars):
    found, out = first
    rows = found.table().to_pylist()
    assert [row["name"] for row in rows] == ["car_1", "car_2", "car_3", "car_4"]
    assert (found.progress.done, found.progress.failed, found.progress.cached) == (4, 2, 0)
    sound, broken, empty = rows[0], rows[2], rows[3]
    answer = json.loads((out / "cars/car_1/diagnosis.json").read_text())
    assert sound["verdict"] == answer["verdict"] and sound["error"] is None and sound["closed"] == answer["how_far"]["closed_fraction"]
    assert [e["id"] for e in sound["effects"]] == [e["id"] for e in answer["which"]["effects"]]
    assert all(p["low"] <= p["value"] <= p["high"] for p in sound["parameters"])
    assert (sound["car"], sound["mileage_km"], str(sound["date"])) == ("A1", 1200.0, "2026-03-01")
    assert sound["version"] and len(sound["binary"]) == 64
    for row in (broken, empty):
        assert row["verdict"] is None and str(cars / row["name"]) in row["error"] and "vehicle.json" in row["error"]
    assert {p.name for p in (out / "cars/car_1").iterdir()} >= {"diagnosis.json", "report.html", "plant.ssv", "vehicle.json"}
    assert (out / "index.html").stat().st_size > 10_000 and not list(out.glob(".kisspoint-*.partial"))


def test_a_joint_posterior_is_whole_and_wider_than_nothing(first):
    import numpy as np
    from kisspoint.fleet import _told

    row = first[0].table().to_pylist()[0]
    mode, H, _, P = _told.matrices(row)
    assert len(mode) == len(row["unknowns"]) >= 12
    told = np.linalg.eigvalsh(H - P)
    # The information that the recordings add to the prior is never negative, and it is not zero.
    assert told.min() > -1e-4 * told.max() and told.max() > 10
    answer = json.loads((first[1] / "cars/car_1/diagnosis.json").read_text())
    sd = np.sqrt(np.diag(np.linalg.inv(H)))
    for k, unknown in enumerate(row["unknowns"]):
        if unknown["kind"] == "tolerance":
            assert mode[k] == pytest.approx(answer["which"]["tolerances"][unknown["name"]], abs=1e-5) and 0 < sd[k] < 1.001
        if unknown["kind"] == "effect":
            _, effect, name = unknown["name"].split(".")
            (found,) = [e for e in answer["which"]["effects"] if e["id"] == effect]
            p = found["parameters"][name]
            # The interval also covers the mean of the effect's form, which is not an unknown of the linear model: at most the size of the form, 12 % of the effect's size.
            half = max(p["high"] - p["value"], p["value"] - p["low"])
            assert 1.96 * sd[k] * 0.999 <= half <= 1.96 * np.hypot(sd[k], 0.12 * p["value"]) * 1.001


def test_the_same_bytes_are_no_work_and_others_are(first, cars, tmp_path):
    out = first[1]
    cache = out / ".kisspoint-cache"
    again = list(fleet.stream(f"{cars}/car_[12]", cache=cache))
    assert [row["cached"] for row in again] == [True, True]
    shutil.copytree(cars / "car_1", tmp_path / "elsewhere/car_1")
    (copy,) = fleet.stream(tmp_path / "elsewhere/car_1", cache=cache)
    assert copy["cached"] and copy["key"] == again[0]["key"]
    # Statements about the car take no part in the diagnosis, and are read again.
    (tmp_path / "elsewhere/car_1/car.json").write_text('{"mileage_km": 5}')
    (copy,) = fleet.stream(tmp_path / "elsewhere/car_1", cache=cache)
    assert copy["cached"] and copy["mileage_km"] == 5.0
    with open(tmp_path / "elsewhere/car_1/r01.csv", "a") as file:
        file.write("\n")
    (copy,) = fleet.stream(tmp_path / "elsewhere/car_1", cache=cache)
    assert not copy["cached"] and copy["key"] != again[0]["key"] and copy["verdict"] == again[0]["verdict"]


def test_another_version_is_other_work(cars, first, monkeypatch):
    (row,) = fleet.stream(cars / "car_1", cache=first[1] / ".kisspoint-cache")
    command, version, _ = _task.installed()
    keys = set()
    folder = cars / "car_1"
    for said, binary in ((version, "0" * 64), ("9.9.9", row["binary"]), (version, row["binary"])):
        keys.add(_task._key(folder, _task.Settings(), said, binary))
    assert len(keys) == 3 and row["key"] in keys
    assert _task._key(folder, _task.Settings(strict=True), version, row["binary"]) not in keys
    assert row["binary"] == sha256(open(command, "rb").read()).hexdigest()


def slow_command(folder, seconds=0.0):
    """A command that counts its runs, and may sleep in each."""
    script = folder / "counted"
    script.write_text(f'#!/bin/sh\n[ "$1" = diagnose ] && echo x >> "{folder}/runs" && sleep {seconds}\nexec "{find_command()}" "$@"\n')
    script.chmod(0o755)
    return script


def runs(folder):
    file = folder / "runs"
    return len(file.read_text().split()) if file.exists() else 0


def test_a_run_that_is_killed_is_completed_by_the_next(cars, tmp_path):
    """kill -9 at several moments: finished campaigns are not diagnosed again, and the final result is that of an undisturbed run."""
    script, out = slow_command(tmp_path), tmp_path / "out"
    env = {**os.environ, "KISSPOINT": str(script), "PYTHONPATH": str(ROOT / "python")}
    words = [sys.executable, "-m", "kisspoint.fleet", f"{cars}/*", "--out", str(out), "--workers", "1"]
    for wanted in (0, 1):
        child = subprocess.Popen(words, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        until = time.monotonic() + 300
        while time.monotonic() < until and (runs(tmp_path) <= wanted or len(list(out.rglob("*.zip"))) < wanted):
            time.sleep(0.02)
        os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        assert not (out / "fleet.parquet").exists()
    kept = len(list(out.rglob("*.zip")))
    assert kept >= 1
    before = runs(tmp_path)
    done = subprocess.run(words, env=env, capture_output=True, text=True)
    assert done.returncode == 0 and "4 campaigns" in done.stdout and f"{kept} from the cache" in done.stdout, done.stderr
    assert runs(tmp_path) - before == 4 - kept  # campaigns that failed are tried again
    again = subprocess.run(words, env=env, capture_output=True, text=True)
    assert "2 from the cache, 2 without an answer" in again.stdout


def test_two_runs_at_once_on_one_cache_lose_nothing(cars, tmp_path):
    words = [sys.executable, "-m", "kisspoint.fleet", f"{cars}/*", "--cache", str(tmp_path / "cache"), "--json"]
    env = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    outs = [tmp_path / "a", tmp_path / "b"]
    children = [subprocess.Popen([*words, "--out", str(out)], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for out in outs]
    said = [child.communicate() for child in children]
    assert [child.returncode for child in children] == [0, 0], said
    assert len(list((tmp_path / "cache").rglob("*.zip"))) == 2 and not list((tmp_path / "cache").rglob("*.partial"))
    for name in ("cars/car_1/diagnosis.json", "cars/car_2/report.html", "fleet.json"):
        assert (outs[0] / name).read_bytes() == (outs[1] / name).read_bytes()
    (row,) = fleet.stream(cars / "car_1", cache=tmp_path / "cache")
    assert row["cached"]


def test_an_entry_that_is_not_whole_is_made_anew(cars, tmp_path):
    (row,) = fleet.stream(cars / "car_1", cache=tmp_path)
    (entry,) = tmp_path.rglob("*.zip")
    whole = entry.read_bytes()
    for damaged in (whole[: len(whole) // 2], b""):
        entry.write_bytes(damaged)
        (row,) = fleet.stream(cars / "car_1", cache=tmp_path)
        assert not row["cached"] and row["error"] is None and entry.read_bytes() == whole


def test_what_may_pass_is_tried_again_and_what_is_wrong_is_not(cars, tmp_path, monkeypatch):
    script = tmp_path / "dies"
    script.write_text(f'#!/bin/sh\n[ "$1" = diagnose ] && echo x >> "{tmp_path}/runs" && [ $(wc -l < "{tmp_path}/runs") -lt 2 ] && kill -9 $$\nexec "{find_command()}" "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("KISSPOINT", str(script))
    (row,) = fleet.stream(cars / "car_1")
    assert row["error"] is None and row["attempts"] == 2
    (row,) = fleet.stream(cars / "car_3")
    assert row["attempts"] == 1 and "vehicle.json" in row["error"]
    monkeypatch.setenv("KISSPOINT", str(slow_command(tmp_path, 30)))
    (row,) = fleet.stream(cars / "car_1", timeout_s=0.3)
    assert "longer than 0.3 s" in row["error"]


def test_a_run_that_is_cancelled_ends_its_commands(cars, tmp_path, monkeypatch):
    monkeypatch.setenv("KISSPOINT", str(slow_command(tmp_path, 30)))
    rows = fleet.stream([tmp_path / "none", cars / "car_1", cars / "car_2"], workers=2)
    assert next(rows)["error"]
    began = time.monotonic()
    rows.close()
    assert time.monotonic() - began < 10


def test_an_interruption_says_how_to_go_on(cars, tmp_path):
    env = {**os.environ, "KISSPOINT": str(slow_command(tmp_path, 30)), "PYTHONPATH": str(ROOT / "python")}
    words = [sys.executable, "-m", "kisspoint.fleet", f"{cars}/*", "--out", str(tmp_path / "out")]
    # Tests that run in the background, and their child processes, ignore SIGINT, so its default action is restored.
    heeds = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    child = subprocess.Popen(words, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **heeds)
    until = time.monotonic() + 300
    while not runs(tmp_path) and time.monotonic() < until:
        time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=300)
    assert child.returncode == 130 and "the same command continues from there" in said


def test_processes_of_concurrent_futures_do_as_well(cars, first):
    with ProcessPoolExecutor(2) as executor:
        rows = list(fleet.stream(f"{cars}/*", executor, cache=first[1] / ".kisspoint-cache"))
    assert [row["cached"] for row in rows] == [True, True, False, False]


def test_a_scheduler_in_another_process_does_as_well(cars, tmp_path, first):
    pytest.importorskip("distributed")
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    env = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    scheduler_file = tmp_path / "scheduler.json"
    started = []
    try:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": env}
        started.append(subprocess.Popen([*dask, "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(scheduler_file)], **quiet))
        until = time.monotonic() + 300
        while not scheduler_file.exists() and time.monotonic() < until:
            time.sleep(0.1)
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(scheduler_file), "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        started.append(subprocess.Popen([*worker, "--local-directory", str(tmp_path)], **quiet))
        words = [f"{cars}/*", "--out", str(tmp_path / "out"), "--scheduler", str(scheduler_file), "--cache", str(first[1] / ".kisspoint-cache")]
        done = subprocess.run([sys.executable, "-m", "kisspoint.fleet", *words], env=env, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0 and "4 campaigns, 2 from the cache, 2 without an answer" in done.stdout, done.stderr
    finally:
        for child in started:
            child.kill()
            child.wait()


def test_only_a_few_tasks_are_handed_over_at_a_time(tmp_path):
    """Ten thousand paths without a campaign: the iterator of names advances only as tasks end."""
    from kisspoint.fleet import _engine

    drawn = 0

    def names():
        nonlocal drawn
        for k in range(10_000):
            drawn += 1
            yield _store.Campaign(str(tmp_path / f"none_{k}"), f"none_{k}")

    rows = _engine.run(names(), _task.Settings(retries=0), workers=2)
    for k in range(50):
        assert next(rows)["name"] == f"none_{k}"
    assert drawn < 200
    rows.close()


@pytest.fixture(scope="module")
def s3():
    """An S3 server in this process."""
    server = pytest.importorskip("moto.server")
    pytest.importorskip("s3fs")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("AWS_ACCESS_KEY_ID", "test"), ("AWS_SECRET_ACCESS_KEY", "test"), ("AWS_DEFAULT_REGION", "us-east-1")):
            patch.setenv(name, value)
        served = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
        served.start()
        host, port = served.get_host_and_port()
        yield {"endpoint_url": f"http://{host}:{port}"}
        served.stop()


def test_campaigns_and_answers_may_lie_on_s3(s3, cars):
    import s3fs

    fs = s3fs.S3FileSystem(**s3)
    fs.mkdir("bucket")
    for name in ("car_1", "car_3"):
        fs.put(str(cars / name), f"bucket/cars/{name}", recursive=True)
    found = fleet.diagnose("s3://bucket/cars/*", out="s3://bucket/out/fleet.parquet", storage_options=s3)
    rows = found.table().to_pylist()
    assert [row["campaign"] for row in rows] == ["s3://bucket/cars/car_1", "s3://bucket/cars/car_3"]
    assert rows[0]["verdict"] and "s3://bucket/cars/car_3/vehicle.json" in rows[1]["error"]
    assert json.loads(fs.cat_file("bucket/out/cars/car_1/diagnosis.json"))["verdict"] == rows[0]["verdict"]
    assert b'"cars/car_1/report.html"' in fs.cat_file("bucket/out/index.html")
    again = fleet.diagnose("s3://bucket/cars/*", out="s3://bucket/out/fleet.parquet", storage_options=s3)
    assert again.progress.cached == 1


def test_spark_gets_one_function(cars, first):
    pandas = pytest.importorskip("pandas")
    function = fleet.mapper(cache=str(first[1] / ".kisspoint-cache"))
    frames = [pandas.DataFrame({"campaign": [str(cars / "car_1")]}), pandas.DataFrame({"campaign": [str(cars / "car_4")]})]
    made = list(function(iter(frames)))
    assert [list(frame.columns) for frame in made] == [fleet.SCHEMA.names] * 2
    assert made[0]["verdict"][0] and made[1]["error"][0]
    assert "`mileage_km` double" in fleet.SPARK_SCHEMA and "`effects` array<struct<`id`: string" in fleet.SPARK_SCHEMA


def test_names_are_told_apart_and_patterns_find_folders(cars, tmp_path):
    shutil.copytree(cars / "car_4", tmp_path / "x/car_1")
    found = list(_store.campaigns([cars / "car_1", tmp_path / "x/car_1"]))
    assert found[0].name == "car_1" and found[1].name.startswith("car_1-") and len({c.name for c in found}) == 2
    assert [c.name for c in _store.campaigns(cars)] == ["car_1", "car_2", "car_3"]
    (row,) = fleet.stream(str(tmp_path / "nothing*"))
    assert "nothing*" in row["error"]


def test_what_is_said_of_the_cars_is_checked(cars, tmp_path, first):
    table = tmp_path / "cars.csv"
    table.write_text("campaign,mileage_km,date\ncar_2,77,2026-04-01\n")
    found = fleet.diagnose(f"{cars}/car_[12]", out=tmp_path / "out/fleet.parquet", about=table, cache=first[1] / ".kisspoint-cache")
    assert [row["mileage_km"] for row in found.table().to_pylist()] == [1200.0, 77.0]
    for text, said in (
        ("car,mileage_km\na,1\n", "no column campaign"),
        ("campaign,mileage_km\na,far\n", "line 2: mileage_km is 'far'"),
        ("campaign,milage\na,1\n", "unknown key 'milage'"),
        ("campaign,date\na,yesterday\n", "date is 'yesterday'"),
    ):
        table.write_text(text)
        with pytest.raises(ValueError, match=said):
            fleet.diagnose(f"{cars}/car_1", out=tmp_path / "out/fleet.parquet", about=table)


def test_the_command_hands_over_and_says_what_it_needs(cars, tmp_path, kisspoint):
    env = {**os.environ, "PYTHONPATH": str(ROOT / "python"), "KISSPOINT_PYTHON": sys.executable}
    done = subprocess.run([find_command(), "fleet", "--help"], env=env, capture_output=True, text=True)
    assert done.returncode == 0 and "pip install '.[fleet]'" in done.stdout and "--scheduler ADDRESS" in done.stdout
    done = subprocess.run([find_command(), "fleet", str(cars / "car_4"), "--out", str(tmp_path)], env=env, capture_output=True, text=True)
    assert done.returncode == 1 and "1 without an answer" in done.stdout
    done = subprocess.run([find_command(), "fleet", "x", "--out", "y"], env={**env, "KISSPOINT_PYTHON": "/no/python"}, capture_output=True, text=True)
    assert done.returncode == 1 and "KISSPOINT_PYTHON" in done.stderr
    done = subprocess.run([find_command(), "fleet", "x"], env=env, capture_output=True, text=True)
    assert done.returncode == 2


def test_the_documentation_names_every_option():
    page = (ROOT / "docs/fleet.md").read_text()
    for action in command_line.parser()._actions:
        for option in action.option_strings:
            if option.startswith("--") and option != "--help":
                assert f"`{option}" in page, option
    for field in fleet.SCHEMA.names:
        assert f"`{field}`" in page, field


def test_progress_is_told(cars, first):
    seen = []
    lock = threading.Lock()

    def tell(now):
        with lock:
            seen.append(now)

    list(fleet.stream(f"{cars}/*", cache=first[1] / ".kisspoint-cache", progress=tell))
    assert [p.done for p in seen] == [1, 2, 3, 4] and seen[-1].failed == 2 and seen[-1].cached == 2
