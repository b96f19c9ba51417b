"""Writes the parts of a fleet's answer other than the rows: fleet.json, the shrunk estimates, the corrections, the page."""

import json
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from .. import _command
from ._store import Place
from ._table import Row

SHOWN = 20_000
"""Largest number of cars on the page. Of a larger fleet it shows every outlier and an even selection of the others, and its title says so."""

_COLUMNS = ["campaign", "name", "report", "error", "verdict", "confidence", "where", "effects", "closed", "before", "after", "mileage_km", "date"]


def write(folder: Place, rows: Place, found: dict[str, Any], estimates: pa.Table, vehicles: dict[str, tuple[dict[str, Any], dict[str, Any] | None]]) -> None:
    """Writes all parts, the page last."""
    with tempfile.TemporaryDirectory(prefix="kisspoint-fleet-") as work:
        for k, (digest, (corrections, corrected)) in enumerate(vehicles.items()):
            ending = "" if k == 0 else f"-{digest}"
            _json(folder / f"corrections{ending}.json", corrections)
            if corrected and "vehicle" in corrected:
                _json(folder / f"vehicle.corrected{ending}.json", corrected["vehicle"])
            population = next(p for p in found["populations"] if p["vehicle"] == digest)
            population["corrections"] = corrections
            population["not_in_file"] = (corrected or {}).get("not_in_file", {})
            if corrected and "error" in corrected:
                population["not_corrected"] = corrected["error"]
        table = Path(work) / "cars.parquet"
        pq.write_table(estimates, table, compression="zstd")
        (folder / "cars.parquet").write_file(table)
        _json(folder / "fleet.json", found)
        lines, population_file, page = Path(work) / "rows.jsonl", Path(work) / "fleet.json", Path(work) / "index.html"
        population_file.write_text(json.dumps(_brief(found)), encoding="utf-8")
        shown = 0
        with open(lines, "w", encoding="utf-8") as text:
            for row in _rows(folder, rows, found, estimates):
                text.write(json.dumps(row, default=str) + "\n")
                shown += 1
        title = folder.path.rstrip("/").rsplit("/", 1)[-1]
        if shown < found["campaigns"]:
            title += f", {shown} of {found['campaigns']} cars"
        words = [str(_command.path()), "index", "--rows", str(lines), "--population", str(population_file), "--out", str(page), "--title", title]
        done = subprocess.run(words, capture_output=True, encoding="utf-8")
        if done.returncode != 0:
            raise _command.KisspointError(done.stderr.strip().removeprefix("kisspoint: "))
        (folder / "index.html").write_file(page)


def _json(place: Place, content: Any) -> None:
    place.write((json.dumps(content, indent=1, ensure_ascii=False, default=str) + "\n").encode())


def _brief(found: dict[str, Any]) -> dict[str, Any]:
    """Data of the population for the page. Vehicle files beyond the first are given only by their number of cars."""
    return {**found, "outliers": [{"name": one["name"]} for one in found["outliers"]], "populations": [{"cars": p["cars"]} for p in found["populations"]]}


def _rows(folder: Place, file: Place, found: dict[str, Any], estimates: pa.Table) -> Iterator[Row]:
    off = {one["campaign"]: _words(one) for p in found["populations"] for one in p.get("outliers", [])}
    values: dict[str, dict[str, list[Any]]] = {}
    for batch in estimates.to_batches(max_chunksize=65536):
        columns = [batch.column(name).to_pylist() for name in ("campaign", "number", "value", "sd", "unit")]
        for campaign, number, value, sd, unit in zip(*columns, strict=True):
            values.setdefault(campaign, {})[number] = [value, sd, unit]
    each = max(1, -(-found["campaigns"] // SHOWN))
    root = f"{folder.url.rstrip('/')}/"
    for batch in pq.ParquetFile(file.path, filesystem=file.fs).iter_batches(batch_size=512, columns=_COLUMNS):
        for k, row in enumerate(batch.to_pylist()):
            campaign = row.pop("campaign")
            if k % each and campaign not in off:
                continue
            report = row["report"] or ""
            # Relative if the report lies below the page, so that the folder can be moved and mailed.
            row["report"] = quote(report[len(root) :]) if report.startswith(root) else report or None
            row["effects"] = row["effects"] or []
            row["off"] = off.get(campaign)
            row["values"] = values.get(campaign, {})
            yield row


def _words(outlier: dict[str, Any]) -> list[str]:
    numbers = [f"{one['number']} by {one['by']:+.1f} tolerances (probability {one['probability']:.2f})" for one in outlier["numbers"]]
    return numbers + [f"{one['effect']} (probability {one['probability']:.2f})" for one in outlier["effects"]]
