"""Scores of mutation testing, and the survivors that nobody knows yet.

    python3 packaging/mutants.py packaging/mutants.txt target/mutants/plant/mutants.out …

The list of known survivors has one line each, `file: mutant — reason`, without line numbers, which change; a mutant that stands several times in
one function has `2 × ` before it. A line whose mutant no longer exists does no harm, but is named.
"""

import json
import re
import sys
from collections import Counter
from pathlib import Path

LINE = re.compile(r"(?:(\d+) × )?(\S+): (.+?) — (.+)")


def name_of(mutant):
    """`src/a.rs:12:34: replace …` without line and column."""
    return re.sub(r"^(\S+?):\d+:\d+: ", r"\1: ", mutant)


def known_survivors(path):
    known = Counter()
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        match = LINE.fullmatch(line)
        if not match:
            sys.exit(f"{path}, line {number}: not of the form `file: mutant — reason`")
        known[f"{match[2]}: {match[3]}"] += int(match[1] or 1)
    return known


def names(folder, kind):
    path = folder / f"{kind}.txt"
    return Counter(name_of(line) for line in path.read_text(encoding="utf-8").splitlines() if line) if path.exists() else Counter()


def main(baseline, *folders):
    known, failed = known_survivors(Path(baseline)), False
    for folder in map(Path, folders):
        caught, missed, late = (names(folder, kind) for kind in ("caught", "missed", "timeout"))
        noticed, tried = caught.total() + late.total(), caught.total() + late.total() + missed.total()
        possible = len(json.loads((folder / "mutants.json").read_text(encoding="utf-8"))) if (folder / "mutants.json").exists() else tried
        new = missed - known
        # Known survivors make no difference that a test could notice, so they do not count.
        alike = (missed & known).total()
        share = f"{100 * noticed / (tried - alike):.1f} %" if tried > alike else "–"
        print(
            f"{folder.parent.name}: {noticed} of {tried - alike} noticed ({share}), and {alike} known to survive; {possible} are possible; {new.total()} survivors are new"
        )
        for mutant, count in sorted(new.items()):
            failed = True
            print(f"  survived: {mutant}" + (f" ({count} times)" if count > 1 else ""))
        for mutant in sorted(known.keys() & (caught + late).keys() - missed.keys()):
            print(f"  noticed now, its line can go: {mutant}")
    sys.exit(2 if failed else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
