"""`kisspoint fleet`, or `python -m kisspoint.fleet`."""

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from .. import KisspointError
from . import Fleet, Progress, diagnose
from . import _store as store

DESCRIPTION = """Diagnose many campaigns, one task each with one thread, and say what they have in common.

DIR gets fleet.parquet (a row per campaign, failures included), cars/NAME/ (diagnosis.json, report.html, plant.ssv, vehicle.json), fleet.json (the
population), cars.parquet (estimates of each car given the whole fleet), corrections.json, vehicle.corrected.json, and index.html, one page for all.

A campaign already diagnosed with the same bytes by the same version of kisspoint is taken from the cache. Ctrl-C stops a run and keeps what is done; the
same command then completes it, however the run ended."""

EXAMPLES = """examples:
  kisspoint fleet 'cars/*' --out out                                       on all cores of this machine
  kisspoint fleet 's3://bucket/cars/*' --out s3://bucket/out --workers 8   from and to a store; fsspec's variables give access, e.g. FSSPEC_S3_ENDPOINT_URL
  kisspoint fleet 'cars/*' --out out --scheduler tcp://10.0.0.7:8786       on a cluster of dask.distributed that sees the same folders or stores
  find /data -name vehicle.json -printf '%h\\n' | kisspoint fleet - --out out

Needs the Python package with its extra: in a checkout pip install '.[fleet]' (with Dask '.[fleet,dask]'), of a wheel
pip install 'FILE.whl[fleet]'. Stores need their fsspec package, e.g. s3fs.
Exit codes: 0 done, even if some campaigns have no answer; 1 no campaign has one, or a file is wrong; 2 the command line is wrong; 130 stopped by Ctrl-C."""


def parser() -> argparse.ArgumentParser:
    """Parser of the command line."""
    made = argparse.ArgumentParser(prog="kisspoint fleet", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("campaigns", metavar="CAMPAIGN", nargs="+", help="folder, URL or pattern of campaigns; a folder that holds some stands for them; - reads one per line")
    made.add_argument("--out", metavar="DIR", required=True, help="folder or URL for the answer")
    made.add_argument("--scheduler", metavar="ADDRESS", help="scheduler of dask.distributed, tcp://host:port, or a scheduler file")
    made.add_argument("--workers", metavar="N", type=_count, help="campaigns at a time on this machine (default: all cores)")
    made.add_argument("--about", metavar="FILE", help="CSV with campaign (folder's name), and car, mileage_km, date or some of them")
    made.add_argument("--cache", metavar="DIR", help="cache to share between runs (default: DIR/.kisspoint-cache)")
    made.add_argument("--channel-map", metavar="FILE", help="names and units of the channels, TOML or JSON")
    made.add_argument("--strict", action="store_true", help="refuse a campaign in which any recording has a defect")
    made.add_argument("--fmu", action="store_true", help="write DrivelinePlant.fmu of each car, too; without it plant.ssv holds its numbers")
    made.add_argument("--retries", metavar="N", type=int, default=2, help="further attempts after a failure that may pass, such as a store that does not answer (%(default)s)")
    made.add_argument("--timeout", metavar="S", type=float, default=3600.0, help="longest time of one diagnosis, s (%(default)g)")
    made.add_argument("--json", action="store_true", help="print fleet.json")
    return made


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number of workers; give 1 or more")
    return value


def main(arguments: list[str] | None = None) -> int:
    """Runs the command line. Returns its exit code."""
    asked = parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, _interrupt)
    teller = Teller()
    try:
        engine = _cluster(asked.scheduler) if asked.scheduler else None
        campaigns: list[str] | Iterator[str] = asked.campaigns if asked.campaigns != ["-"] else (line.strip() for line in sys.stdin if line.strip())
        if isinstance(campaigns, list):
            teller.total = _number(campaigns)
        out = store.Place.of(asked.out) / "fleet.parquet"
        found = diagnose(
            campaigns,
            engine,
            out.url,
            about=asked.about,
            cache=asked.cache,
            workers=asked.workers,
            channel_map=asked.channel_map,
            strict=asked.strict,
            fmu=asked.fmu,
            retries=asked.retries,
            timeout_s=asked.timeout,
            progress=teller.tell,
        )
    except KeyboardInterrupt:
        teller.end()
        print(f"kisspoint: stopped; {teller.now.done} campaigns are done and kept, and the same command continues from there", file=sys.stderr)
        return 130
    except (KisspointError, OSError, ValueError) as error:
        teller.end()
        print(f"kisspoint: {error}\nFor usage and examples: kisspoint fleet --help", file=sys.stderr)
        return 1
    teller.end()
    print(json.dumps(found.population, indent=1) if asked.json else summary(found), flush=True)
    return 1 if found.progress.done == found.progress.failed else 0


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _number(asked: Iterable[str]) -> int:
    return sum(1 for _ in store.campaigns(asked))


def _cluster(address: str) -> Any:
    try:
        import distributed
    except ModuleNotFoundError:
        raise KisspointError("--scheduler needs Dask: pip install distributed") from None
    client: Any = distributed.Client
    try:
        return client(scheduler_file=address, timeout=30) if Path(address).is_file() else client(address, timeout=30)
    except (OSError, TimeoutError, ValueError) as error:
        raise KisspointError(f"no scheduler answers at {address}: {error}; start one with `dask scheduler`, and workers with `dask worker {address}`") from None


class Teller:
    """Shows the progress of a run: on a terminal a line that is updated, elsewhere a line for every tenth of the campaigns."""

    def __init__(self) -> None:
        self.total: int | None = None
        self.now = Progress()
        self._began = time.monotonic()
        self._written = 0.0
        self._tenth = 0
        self._terminal = sys.stderr.isatty()

    def tell(self, now: Progress) -> None:
        """Stores the progress, and shows it if it is time to."""
        self.now = now
        passed = time.monotonic() - self._began
        if self._terminal and passed - self._written > 0.2:
            self._written = passed
            print(f"\r\x1b[K{self._line(passed)}", end="", file=sys.stderr, flush=True)
        elif not self._terminal and self.total and 10 * now.done // self.total > self._tenth:
            self._tenth = 10 * now.done // self.total
            print(self._line(passed), file=sys.stderr, flush=True)

    def _line(self, passed: float) -> str:
        now, total = self.now, self.total
        parts = [f"{now.done} of {total} campaigns" if total else f"{now.done} campaigns"]
        parts += [f"{now.cached} from the cache"] if now.cached else []
        parts += [f"{now.failed} without an answer"] if now.failed else []
        parts.append(f"{_time(passed)} so far")
        worked = now.done - now.cached
        if total and worked > 0 and now.done < total:
            left = (total - now.done) * passed / now.done
            parts.append(f"about {_time(left)} to go")
        return ", ".join(parts)

    def end(self) -> None:
        """Removes the line."""
        if self._terminal:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def summary(found: Fleet) -> str:
    """The answer in a few lines."""
    told, p = found.progress, found.population
    lines = [f"{told.done} campaigns, {told.cached} from the cache, {told.failed} without an answer"]
    for one in p["numbers"]:
        if one["off"]:
            lines.append(f"  off on all cars: {one['number']} by {one['mean']:+.2f} tolerances (95 %: {one['low']:+.2f} to {one['high']:+.2f})")
        if one["tolerance"] != "as_declared" and one["kind"] == "tolerance":
            spread = one["spread"]
            lines.append(f"  tolerance {one['tolerance'].replace('_', ' ')}: {one['number']} spreads by {spread['value']:.2f} times the declared one (95 %: {spread['low']:.2f} to {spread['high']:.2f})")
        for drift in one["drift"]:
            if drift["significant"]:
                lines.append(f"  moves: {one['number']} by {drift['slope']:+.3g} tolerances per {drift['per']} ({drift['low']:+.3g} to {drift['high']:+.3g})")
    for one in p["effects"]:
        lines.append(f"  {one['effect']}: {one['cars']} cars, share {100 * one['share']:.1f} % (95 %: {100 * one['low']:.1f} to {100 * one['high']:.1f})")
    lines.append(f"  outliers: {len(p['outliers'])} cars")
    lines.append(f"  written: {found.page}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
