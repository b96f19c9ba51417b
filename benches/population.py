"""What a fleet's population is worth: cars drawn around one vehicle file, really diagnosed and pooled, against what is true of them.

    kisspoint blind --fleet --cars 80 --seed 20261124 --draw-only --keep cars
    kisspoint fleet 'cars/case_*' --out out
    python benches/population.py cars out

Counts means and spreads of the fleet, and numbers of single cars, that lie in their 95 % intervals; cars with an effect that were found; and how far a car is from
its vehicle file before and after it is corrected. Numbers are in standard deviations of the declared tolerances. Figures: docs/fleet.md.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq


def combined(parts, values):
    """A pooled number of several tolerances that act alike, from those."""
    return sum(share * values[name] for name, share in parts.items())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cars", type=Path)
    parser.add_argument("out", type=Path)
    asked = parser.parse_args()
    truth = json.loads((asked.cars / "population.json").read_text())
    carries = {name for name, effects in json.loads((asked.cars / "answers.json").read_text()).items() if effects}
    fleet = json.loads((asked.out / "fleet.json").read_text())
    numbers = [one for one in fleet["numbers"] if one["kind"] == "tolerance" and set(one["parts"]) <= set(truth["numbers"])]
    print(f"{fleet['pooled']} cars, {fleet['errors']} errors; {truth['effect']} in {len(carries)}")
    print(f"{'number':44} {'true':>12} {'mean':>7} {'95 %':>16} {'spread':>7} {'95 %':>14}  informed")
    inside = np.zeros((2, 2), int)
    for one in numbers:
        parts, spread = one["parts"], one["spread"]
        # The cars that were drawn, and not only their law: a fleet of eighty is off from it by chance.
        each = np.array([combined(parts, car) for car in truth["cars"].values()])
        mean = combined(parts, {name: n["mean"] for name, n in truth["numbers"].items()})
        sigma = np.sqrt(combined({name: share**2 for name, share in parts.items()}, {name: n["spread"] ** 2 for name, n in truth["numbers"].items()}))
        hits = [one["low"] <= mean <= one["high"], spread["low"] <= sigma <= spread["high"]]
        inside += [[hits[0], 1], [hits[1], 1]]
        print(
            f"{one['number']:44} {mean:+5.2f} ±{sigma:4.2f} {one['mean']:+7.2f} {one['low']:+7.2f} to {one['high']:+5.2f} {spread['value']:7.2f} {spread['low']:5.2f} to {spread['high']:5.2f}"
            f"  {100 * one['informed']:3.0f} %  {'' if all(hits) else 'MISSED '}{'off ' if one['off'] else ''}{one['tolerance'] if one['tolerance'] != 'as_declared' else ''} (drawn: {each.mean():+.2f} ±{each.std():.2f})"
        )
    print(f"means in their 95 % intervals: {inside[0][0]} of {inside[0][1]}; spreads: {inside[1][0]} of {inside[1][1]}")
    by_name = {one["number"]: one for one in numbers}
    held: list[bool] = []
    errors: dict[tuple[bool, str], list[float]] = {}
    for row in pq.read_table(asked.out / "cars.parquet").to_pylist():
        one = by_name.get(row["number"])
        if one is None:
            continue
        factor = one["sigma"] * (100.0 if one["relative"] else 1.0)
        true = combined(one["parts"], truth["cars"][row["name"]])
        value, sd = row["value"] / factor, row["sd"] / factor
        held.append(abs(value - true) < 1.96 * sd)
        ill = row["name"] in carries
        for name, off in (("vehicle file", true), ("corrected", true - (one["mean"] if one["off"] else 0.0)), ("each car, given the fleet", true - value)):
            errors.setdefault((ill, name), []).append(off)
    print(f"numbers of single cars in their 95 % intervals: {sum(held)} of {len(held)} ({100 * np.mean(held):.1f} %)")
    for ill in (False, True):
        told = ", ".join(f"{name} {np.sqrt(np.mean(np.square(e))):.2f} (median {np.median(np.abs(e)):.2f})" for (of, name), e in errors.items() if of == ill)
        print(f"rms distance to cars {'with' if ill else 'without'} the effect: {told}")
    named = {one["name"] for one in fleet["outliers"] if any(e["effect"] == truth["effect"] for e in one["effects"])}
    others = {one["name"] for one in fleet["outliers"] if one["effects"]} - named
    by_number = {one["name"] for one in fleet["outliers"] if one["numbers"]}
    print(f"cars with the effect: named {len(named & carries)} of {len(carries)}; without: given it {len(named - carries)}, given another {len(others - carries)}, an outlier by a number {len(by_number - carries)} of {len(truth['cars']) - len(carries)}")


if __name__ == "__main__":
    main()
