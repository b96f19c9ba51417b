"""Campaigns from tables in memory."""

import csv
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write(folder: Path, recordings: Mapping[str, Any], about: Mapping[str, Mapping[str, Any]], vehicle: Any) -> None:
    """Writes a campaign's folder; a recording is a DataFrame, or anything that maps column names to numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    unknown = set(recordings) ^ set(about)
    if unknown:
        raise ValueError(f"recordings and about must name the same recordings; these stand in one alone: {', '.join(sorted(unknown))}")
    for name, table in recordings.items():
        check(name, table)
    document = dict(vehicle) if isinstance(vehicle, Mapping) else json.loads(Path(vehicle).read_text(encoding="utf-8"))
    (folder / "vehicle.json").write_text(json.dumps(document), encoding="utf-8")
    (folder / "recordings.json").write_text(json.dumps({name: dict(fields) for name, fields in about.items()}), encoding="utf-8")
    for name, table in recordings.items():
        columns = [str(column) for column in table.keys()]
        cells = [_column(name, str(column), table[column]) for column in table.keys()]
        with open(folder / f"{name}.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*cells, strict=True))


def check(name: str, table: Any) -> None:
    """Refuses a recording that keeps its time in the index."""
    index = getattr(table, "index", None)
    kind = type(index).__name__
    if "time_s" in [str(column) for column in table.keys()]:
        return
    if kind in ("DatetimeIndex", "TimedeltaIndex", "PeriodIndex"):
        how = "add it in seconds: table['time_s'] = (table.index - table.index[0]).total_seconds()"
    elif getattr(index, "name", None) == "time_s":
        how = "make it one: table.reset_index()"
    else:
        return
    raise ValueError(f"{name}: the time is in the index ({kind}), not in a column time_s; {how}")


def _column(recording: str, column: str, values: Any) -> list[str]:
    return [_cell(recording, column, row, value) for row, value in enumerate(values)]


def _cell(recording: str, column: str, row: int, value: Any) -> str:
    # None, pd.NA and pd.NaT are gaps, as NaN is.
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return ""
    wrong = f"{recording}, column {column}, row {row}: {value!r} is not a number"
    if hasattr(value, "timestamp") or hasattr(value, "total_seconds"):
        raise ValueError(f"{wrong}; give times as seconds from the start of the recording")
    try:
        number = float(value) if not isinstance(value, str) else math.inf
    except (TypeError, ValueError) as error:
        raise ValueError(f"{wrong}; convert or drop the column") from error
    if isinstance(value, str):
        raise ValueError(f"{wrong} but text; convert the column (pandas.to_numeric) or drop it")
    return "" if math.isnan(number) else repr(number)
