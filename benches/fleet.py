"""A fleet on this machine: speed-up with workers, overhead of the engine, memory of the client.

    nice python benches/fleet.py --campaigns 1000 --workers 1 2 --folder /tmp/fleet

Makes copies of a campaign with other bytes, diagnoses them with each number of workers and a cache of its own, and then once more from the cache.
Prints one JSON line per run. $KISSPOINT names the command. Figures: docs/fleet.md.

With --stand-in the command copies an answer that is there: then all that is measured is the engine, and a thousand campaigns take seconds.

- `overhead`: time of the tasks that is not the command's, relative to the command's
- `speed_up`: campaigns per second relative to the first number of workers
- `rss_MB`: memory of the client after a tenth, half, and all of the campaigns
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))
os.environ.setdefault("KISSPOINT", str(ROOT / "target/quick/kisspoint"))
os.environ.setdefault("OMP_NUM_THREADS", "1")

from kisspoint import fleet  # noqa: E402

EXAMPLE = ROOT / "tests/data/campaigns/example"


def copies(folder, count, source):
    """Campaigns that differ in a comment; recordings are linked, for a disk need not hold each a thousand times."""
    document = json.loads((source / "vehicle.json").read_text())
    for k in range(count):
        car = folder / f"car_{k:06}"
        if car.exists():
            continue
        car.mkdir(parents=True)
        for file in source.iterdir():
            if file.name != "vehicle.json":
                (car / file.name).symlink_to(file.resolve())
        (car / "vehicle.json").write_text(json.dumps({"_": str(k), **document}))
    return [str(folder / f"car_{k:06}") for k in range(count)]


def stand_in(folder):
    """A command that does no work: its answer is that of the bundled campaign."""
    answer, script = folder / "answer", folder / "stand_in"
    command = os.environ["KISSPOINT"]
    if not answer.exists():
        subprocess.run([command, "diagnose", EXAMPLE, "--out", answer, "--no-fmu"], check=True, stdout=subprocess.DEVNULL)
    # kisspoint diagnose CAMPAIGN --out DIR …
    script.write_text(f'#!/bin/sh\n[ "$1" = diagnose ] || exec "{command}" "$@"\nexec cp -r "{answer}" "$4"\n')
    script.chmod(0o755)
    return script


def rss_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def run(cars, workers, cache, executor=None, passes=1):
    """Rows are let go as they come, as the writer of the Parquet file does it."""
    seconds = command = 0.0
    failed = cached = done = 0
    marks = {max(1, len(cars) * passes // part): None for part in (10, 2, 1)}
    began, used = time.monotonic(), os.times()
    for row in fleet.stream(cars * passes, executor, cache=cache, workers=workers):
        done += 1
        failed += row["error"] is not None
        cached += row["cached"]
        seconds += row["seconds"]
        command += row.get("command_s") or 0.0
        if done in marks:
            marks[done] = round(rss_mb(), 1)
    wall = time.monotonic() - began
    now = os.times()
    return {
        "campaigns": done,
        "workers": workers,
        "failed": failed,
        "cached": cached,
        "wall_s": round(wall, 1),
        "per_second": round(done / wall, 3),
        "task_s": round(seconds / done, 4),
        "command_s": round(command / max(done - cached, 1), 4),
        "overhead": round((seconds - command) / command, 4) if command else None,
        # What the client itself works per campaign, whatever else the machine does.
        "client_cpu_s": round((now.user - used.user + now.system - used.system) / done, 5),
        "command_cpu_s": round((now.children_user - used.children_user + now.children_system - used.children_system) / done, 4),
        "rss_MB": list(marks.values()),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--campaigns", type=int, default=1000)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--folder", type=Path, default=Path("/tmp/kisspoint-fleet-bench"))
    parser.add_argument("--campaign", type=Path, default=EXAMPLE, help="campaign to copy; the bundled one by default")
    parser.add_argument("--stand-in", action="store_true", help="a command that copies an answer in place of the diagnosis: what the engine alone can do")
    parser.add_argument("--passes", type=int, default=10, help="how often all are asked for again, from the cache")
    asked = parser.parse_args()
    cars = copies(asked.folder / "cars", asked.campaigns, asked.campaign)
    if asked.stand_in:
        os.environ["KISSPOINT"] = str(stand_in(asked.folder))
    first = None
    for workers in asked.workers:
        cache = asked.folder / f"cache_{workers}"
        shutil.rmtree(cache, ignore_errors=True)
        found = run(cars, workers, cache)
        first = first or found["per_second"]
        print(json.dumps({"run": "new", **found, "speed_up": round(found["per_second"] / first, 3)}), flush=True)
    print(json.dumps({"run": "from the cache", **run(cars, asked.workers[-1], asked.folder / f"cache_{asked.workers[-1]}", passes=asked.passes)}), flush=True)


if __name__ == "__main__":
    main()
