"""Campaigns from tables in memory."""

import csv
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ._command import KisspointError


def write(folder: Path, recordings: Mapping[str, Any], about: Mapping[str, Mapping[str, Any]], vehicle: Any) -> None:
    """Writes a campaign's folder; a recording is a DataFrame, or anything that maps column names to numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    unknown = set(recordings) ^ set(about)
    if unknown:
        raise ValueError(f"recordings and about must name the same recordings; these stand in one alone: {', '.join(sorted(unknown))}")
    document = dict(vehicle) if isinstance(vehicle, Mapping) else json.loads(Path(vehicle).read_text(encoding="utf-8"))
    (folder / "vehicle.json").write_text(json.dumps(document), encoding="utf-8")
    (folder / "recordings.json").write_text(json.dumps({name: dict(fields) for name, fields in about.items()}), encoding="utf-8")
    for name, table in recordings.items():
        columns = [str(column) for column in table.keys()]
        with open(folder / f"{name}.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*(map(_cell, table[column]) for column in table.keys()), strict=True))


def _cell(value: Any) -> str:
    number = float(value)
    return "" if math.isnan(number) else repr(number)


def read_csv(path: Path) -> dict[str, list[float]]:
    """Columns of a recording whose CSV file has the contract's names."""
    if not path.is_file():
        raise KisspointError(f"{path.name} is not in {path.parent}: only recordings in CSV with our column names can be replayed here; load_plant steps any")
    with open(path, newline="", encoding="utf-8-sig") as file:
        rows = list(csv.reader(file))
    return {name: [float(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}
