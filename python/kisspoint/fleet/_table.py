"""The row of a campaign: its columns, and how they follow from diagnosis.json."""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

import pyarrow as pa

Row = dict[str, Any]

_number, _word = pa.float64(), pa.string()
_effect = pa.struct({"id": _word, "probability": _number, "ambiguous_with": pa.list_(_word)})
_parameter = pa.struct({"effect": _word, "parameter": _word, "value": _number, "low": _number, "high": _number, "unit": _word})
_explanation = pa.struct({"effects": pa.list_(_word), "missing_law": _word, "probability": _number})
_unknown = pa.struct(
    {
        "name": _word,
        "kind": _word,
        "value": _number,
        "centre": _number,
        "sigma": _number,
        "relative": pa.bool_(),
        "one_sided": pa.bool_(),
        "unit": _word,
        "same_as": _word,
        "per_sigma": _number,
    }
)
_entry = pa.struct({"row": pa.int32(), "column": pa.int32(), "value": _number})

SCHEMA = pa.schema(
    {
        "campaign": _word,  # path or URL
        "name": _word,  # folder of its answer
        "car": _word,
        "mileage_km": _number,
        "date": pa.date32(),
        "error": _word,  # why there is no answer
        "verdict": _word,
        "confidence": _number,
        "sentence": _word,
        "where": _word,  # subsystem with the largest share of the gap, or of the unexplained gap
        "effects": pa.list_(_effect),
        "parameters": pa.list_(_parameter),  # estimates with 95 % intervals
        "closed": _number,  # share of the gap closed on held-out data
        "before": _number,  # rad/s
        "after": _number,  # rad/s
        "explanations": pa.list_(_explanation),
        "unknowns": pa.list_(_unknown),  # of the joint posterior; the input of the population, together with the next three columns
        "precision": pa.list_(_number),  # lower triangle, row by row
        "precision_exact": pa.list_(_number),  # the same for exact laws
        "prior_precision": pa.list_(_entry),
        "vehicle": _word,  # digest of the vehicle file's content without comments
        "vehicle_file": _word,
        "diagnosis": _word,
        "report": _word,
        "version": _word,
        "binary": _word,
        "key": _word,  # of the cache
        "cached": pa.bool_(),
        "attempts": pa.int32(),
        "seconds": _number,  # of the whole task
        "command_s": _number,  # of the command alone; null from the cache
    }
)
"""Columns of fleet.parquet."""


def of_diagnosis(found: Mapping[str, Any], vehicle: str) -> Row:
    """The columns that follow from an answer and the vehicle file."""
    place, which, far = found["where"], found["which"], found["how_far"]
    joint = found.get("joint") or {"unknowns": [], "precision": [], "precision_exact": [], "prior_precision": []}
    return {
        "verdict": found["verdict"],
        "confidence": found.get("confidence"),
        "sentence": found.get("sentence"),
        "where": place.get("primary") or place.get("unexplained_at"),
        "effects": [{key: effect[key] for key in ("id", "probability", "ambiguous_with")} for effect in which["effects"]],
        "parameters": [
            {"effect": effect["id"], "parameter": name, **{key: value[key] for key in ("value", "low", "high", "unit")}}
            for effect in which["effects"]
            for name, value in effect["parameters"].items()
        ],
        "closed": far.get("closed_fraction"),
        "before": far.get("before"),
        "after": far.get("after"),
        "explanations": [{key: one[key] for key in ("effects", "missing_law", "probability")} for one in which.get("explanations", [])],
        "unknowns": [_flat(one) for one in joint["unknowns"]],
        "precision": [value for line in joint["precision"] for value in line],
        "precision_exact": [value for line in joint["precision_exact"] for value in line],
        "prior_precision": [dict(zip(("row", "column", "value"), entry, strict=True)) for entry in joint["prior_precision"]],
        "vehicle": digest_of_vehicle(vehicle),
        "vehicle_file": vehicle,
    }


def _flat(unknown: Mapping[str, Any]) -> Row:
    same = unknown["same_as"] or {"parameter": None, "per_sigma": None}
    return {**{k: v for k, v in unknown.items() if k != "same_as"}, "same_as": same["parameter"], "per_sigma": same["per_sigma"]}


def digest_of_vehicle(text: str) -> str:
    """Digest of a vehicle file that does not depend on comments and layout."""

    def bare(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: bare(inner) for key, inner in value.items() if not key.startswith(("_", "$"))}
        return value

    return sha256(json.dumps(bare(json.loads(text)), sort_keys=True).encode()).hexdigest()[:16]


def ddl(schema: pa.Schema = SCHEMA) -> str:
    """The schema in Spark's notation."""
    return ", ".join(f"`{field.name}` {_spark(field.type)}" for field in schema)


def _spark(kind: pa.DataType) -> str:
    if pa.types.is_struct(kind):
        return f"struct<{', '.join(f'`{inner.name}`: {_spark(inner.type)}' for inner in kind)}>"
    if pa.types.is_list(kind):
        return f"array<{_spark(kind.value_type)}>"
    return {"double": "double", "string": "string", "bool": "boolean", "int32": "int", "date32[day]": "date"}[str(kind)]
