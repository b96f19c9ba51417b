"""Diagnoses thousands of campaigns on this machine or a cluster, pools the answers, and shows them on one page.

    from kisspoint import fleet
    found = fleet.diagnose("s3://bucket/cars/*", out="out/fleet.parquet")       # in processes of this machine
    found = fleet.diagnose("cars/*", executor=Client(), out="out/fleet.parquet")  # on a cluster of dask.distributed
    print(found.population["numbers"])
    frame.mapInPandas(fleet.mapper(cache="s3://bucket/cache"), fleet.SPARK_SCHEMA)   # on Spark

Needs the extra `fleet`: in a checkout `pip install '.[fleet]'`. Dask and Spark are needed only where they are used.
"""

from __future__ import annotations

import csv
import json
import os
import secrets
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from . import _engine, _pages, _population, _store, _task
    from ._engine import Progress
    from ._table import SCHEMA, Row, ddl
except ModuleNotFoundError as error:  # pragma: no cover
    raise ModuleNotFoundError(f"{error.name} is missing; a fleet needs the extra [fleet]: in a checkout pip install '.[fleet]'", name=error.name) from error

if TYPE_CHECKING:
    import pandas

__all__ = ["SCHEMA", "SPARK_SCHEMA", "Fleet", "Progress", "diagnose", "mapper", "pool", "stream"]

SPARK_SCHEMA = ddl()
"""Columns of the rows, as a Spark schema."""

_GROUP = 256
"""Number of rows of a row group of the Parquet file; they are held in memory at the same time."""


class Fleet:
    """The answer for a fleet: its files, its rows, and the properties that its cars share."""

    def __init__(self, folder: _store.Place, file: _store.Place, progress: Progress) -> None:
        self._folder = folder
        self._file = file
        self.progress = progress
        """How many campaigns were done, failed, or taken from the cache."""

    @property
    def rows(self) -> str:
        """Path or URL of the Parquet file."""
        return self._file.url

    @property
    def page(self) -> str:
        """Path or URL of the page."""
        return (self._folder / "index.html").url

    @property
    def population(self) -> dict[str, Any]:
        """Content of fleet.json."""
        found: dict[str, Any] = json.loads((self._folder / "fleet.json").read() or b"{}")
        return found

    def table(self, columns: list[str] | None = None) -> pa.Table:
        """The rows, or some of their columns."""
        return pq.read_table(self._file.path, columns=columns, filesystem=self._file.fs)


def stream(
    campaigns: str | Path | Iterable[str | Path],
    executor: Any = None,
    *,
    answers: str | Path | None = None,
    cache: str | Path | None = None,
    workers: int | None = None,
    channel_map: str | Path | None = None,
    strict: bool = False,
    fmu: bool = False,
    retries: int = 2,
    timeout_s: float = 3600.0,
    storage_options: Mapping[str, Any] | None = None,
    progress: Callable[[Progress], None] = lambda _: None,
) -> Iterator[Row]:
    """Diagnoses campaigns and yields a row for each, in the order of the campaigns. Closing the iterator cancels the remaining ones.

    ``campaigns`` is a folder, a URL of any store that fsspec opens (with ``storage_options``), a pattern, or an iterable of these. ``answers`` is the folder for the
    answers, one subfolder for each campaign, ``cache`` the folder of the cache. ``executor`` is a Client of dask.distributed or an executor of
    concurrent.futures; without one, ``workers`` commands run at a time on this machine (by default one per core).

    ``channel_map`` and ``strict`` are as for `kisspoint.diagnose`. With ``fmu``, DrivelinePlant.fmu of each car is written as well. A failure that may be temporary is
    retried up to ``retries`` times; ``timeout_s`` limits the time of a diagnosis. A campaign that fails yields a row with ``error``. ``progress`` is called after each campaign.
    """
    options = dict(storage_options or {})
    settings = _task.Settings(
        out=_absolute(answers, options),
        cache=_absolute(cache, options),
        channel_map=Path(channel_map).read_bytes() if channel_map else None,
        map_ending=Path(channel_map).suffix if channel_map else ".toml",
        strict=strict,
        fmu=fmu,
        retries=retries,
        timeout_s=timeout_s,
        options=options,
    )
    return _engine.run(_store.campaigns(campaigns, options), settings, executor, workers, progress)


def _absolute(url: str | Path | None, options: Mapping[str, Any]) -> str | None:
    """Makes the URL absolute, so that every worker uses the same folder."""
    return None if url is None else _store.Place.of(url, options).url


def diagnose(
    campaigns: str | Path | Iterable[str | Path],
    executor: Any = None,
    out: str | Path = "fleet.parquet",
    *,
    about: str | Path | Mapping[str, Mapping[str, Any]] | None = None,
    cache: str | Path | None = None,
    **settings: Any,
) -> Fleet:
    """Diagnoses campaigns, pools the answers, and writes a page.

    Beside the Parquet file ``out`` it writes ``cars/NAME/`` (diagnosis.json, report.html, plant.ssv and vehicle.json of each campaign; DrivelinePlant.fmu with ``fmu=True``),
    ``fleet.json``, ``cars.parquet`` (estimates of each car given the whole fleet), ``corrections.json``, ``vehicle.corrected.json`` and ``index.html``. ``about`` gives car,
    mileage_km and date of the campaigns by name, as a mapping or as a CSV file with a column ``campaign``; it takes precedence over the campaigns' own car.json.
    ``cache`` is ``.kisspoint-cache`` beside ``out`` unless given. If a run was interrupted, the same call completes it. Further settings are those of `stream`.
    """
    options = settings.get("storage_options")
    file = _store.Place.of(out, options)
    folder = _store.Place(file.fs, file.path.rpartition("/")[0] or ".")
    known = _about(about)
    tell = settings.pop("progress", lambda _: None)
    state = Progress()

    def progress(now: Progress) -> None:
        nonlocal state
        state = now
        tell(now)

    rows = stream(
        campaigns, executor, answers=(folder / "cars").url, cache=cache or (folder / ".kisspoint-cache").url, progress=progress, **settings
    )
    _write(file, (row | known.get(row["name"], {}) for row in rows), rows)
    pool(file.url, storage_options=options)
    return Fleet(folder, file, state)


def _write(file: _store.Place, rows: Iterable[Row], source: Iterator[Row]) -> None:
    """Writes rows as Parquet, one row group at a time. The file appears under its name only when it is complete."""
    beside = Path(file.path).parent if file.local else Path(tempfile.gettempdir())
    beside.mkdir(parents=True, exist_ok=True)
    partial = beside / f".kisspoint-{secrets.token_hex(8)}.partial"
    try:
        with pq.ParquetWriter(partial, SCHEMA, compression="zstd") as writer:
            group: list[Row] = []
            for row in rows:
                group.append(row)
                if len(group) == _GROUP:
                    writer.write_table(pa.Table.from_pylist(group, SCHEMA))
                    group = []
            writer.write_table(pa.Table.from_pylist(group, SCHEMA))
        if file.local:
            os.replace(partial, file.path)
        else:
            file.write_file(partial)
    finally:
        close = getattr(source, "close", None)
        if close:
            close()
        partial.unlink(missing_ok=True)


def _about(given: str | Path | Mapping[str, Mapping[str, Any]] | None) -> dict[str, Row]:
    """car, mileage_km and date, by name of the campaign."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {name: _said(name, dict(entry)) for name, entry in given.items()}
    with open(given, newline="", encoding="utf-8-sig") as text:
        lines = csv.DictReader(text)
        if "campaign" not in (lines.fieldnames or []):
            raise ValueError(f"{given}: has no column campaign; give campaign (its folder's name), and car, mileage_km, date or some of them")
        found = {}
        for line in lines:
            name = line.pop("campaign")
            entry: Row = {key: value for key, value in line.items() if value not in (None, "")}
            if "mileage_km" in entry:
                try:
                    entry["mileage_km"] = float(entry["mileage_km"])
                except ValueError:
                    raise ValueError(f"{given}, line {lines.line_num}: mileage_km is {entry['mileage_km']!r}, which is no number") from None
            found[name] = _said(f"{given}, line {lines.line_num}", entry)
        return found


def _said(where: str, entry: Mapping[str, Any]) -> Row:
    try:
        return _task.about(entry)
    except ValueError as error:
        raise ValueError(f"{where}: {error}; the columns are campaign, car, mileage_km (a number) and date (2026-03-01)") from None


def pool(rows: str | Path, *, storage_options: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Infers the population from the rows of a fleet, and writes fleet.json, cars.parquet, the corrections and the page beside them."""
    file = _store.Place.of(rows, storage_options)
    folder = _store.Place(file.fs, file.path.rpartition("/")[0] or ".")
    found, estimates, vehicles = _population.infer(file)
    _pages.write(folder, file, found, estimates, vehicles)
    return found


def mapper(**settings: Any) -> Callable[[Iterator[pandas.DataFrame]], Iterator[pandas.DataFrame]]:
    """A function for Spark's ``mapInPandas``: frames with a column ``campaign`` (path or URL) become frames of `SPARK_SCHEMA`.

    Settings are those of `stream`; each Spark task diagnoses its campaigns one after the other. Written as one Parquet file, the rows are the input of `pool`, which
    computes everything else.
    """
    settings = {"workers": 1, **settings}

    def map_frames(frames: Iterator[pandas.DataFrame]) -> Iterator[pandas.DataFrame]:
        for frame in frames:
            rows = list(stream([str(url) for url in frame["campaign"]], **settings))
            yield pa.Table.from_pylist(rows, SCHEMA).to_pandas()

    return map_frames
