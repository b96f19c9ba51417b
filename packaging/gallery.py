"""A gallery of reports from drawn cars, to be looked at before a release: one page that leads to eight cases.

    python packaging/gallery.py out/gallery                    some three minutes of one core; $KISSPOINT names the command
    python packaging/gallery.py out/gallery --without drive    some two of them, and half of that with --recordings 5

Healthy, one effect, two, three, one outside the library, thin data (two recordings), a drive, and a fleet (three cars in one call). The cars are
drawn by `kisspoint blind --draw-only`; each case says what was put in, beside what was found.
"""

import argparse
import html
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COMMAND = os.environ.get("KISSPOINT", str(ROOT / "target/quick/kisspoint"))
SEED = 5
CASES = ("healthy", "single", "pair", "three", "unknown", "thin", "drive", "fleet")
PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light dark">
<link rel="icon" href="data:,"><title>Kisspoint: gallery of reports</title>
<style>body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }} table {{ border-collapse: collapse; width: 100%; }}
th, td {{ text-align: left; vertical-align: top; padding: .4rem .8rem .4rem 0; border-bottom: 1px solid #8886; overflow-wrap: break-word; }}
tbody th {{ white-space: nowrap; }}</style>
<h1>Gallery of reports</h1><p>Simulated cars with known faults (seed {seed}): what was put in, and what the diagnosis found.</p>
<table><thead><tr><th scope="col">Case</th><th scope="col">Put in</th><th scope="col">Found</th></tr></thead><tbody>{rows}</tbody></table></html>
"""


def drawn(folder, *options):
    """Campaigns with what was put into each."""
    subprocess.run([COMMAND, "blind", "--seed", str(SEED), "--keep", folder, "--draw-only", *options], check=True, capture_output=True)
    return {folder / name: effects for name, effects in json.loads((folder / "answers.json").read_text()).items()}


def thinned(source, target, keep):
    """The same campaign with the first recordings alone."""
    shutil.copytree(source, target)
    about = json.loads((target / "recordings.json").read_text())
    for name in list(about)[keep:]:
        del about[name]
        (target / f"{name}.csv").unlink()
    (target / "recordings.json").write_text(json.dumps(about))


def library():
    """Ids of the effects, as the model description has them."""
    text = (ROOT / "modelDescription/DrivelinePlant.xml").read_text(encoding="utf-8")
    return {part.split(".")[0] for part in text.split('name="effect.')[1:]}


def choose(work, without, recordings):
    """Campaigns of each case, with what was put in; of each no more than so many recordings, if that is given."""
    bench, known = drawn(work / "bench", "--cars", "20"), library()
    # The first five are none to wait for: a slow actuator with a speed limit takes a minute.
    quick = dict(list(bench.items())[5:])
    first = lambda fits, cars=bench: next(path for path, effects in cars.items() if fits(effects))  # noqa: E731
    inside = lambda count: lambda effects: len(effects) == count and set(effects) <= known  # noqa: E731

    def cut(path, name, keep):
        thinned(path, work / name, keep)
        bench[work / name] = bench[path]
        return work / name

    # Three effects take longest: of those cars the one with the least data.
    size = lambda path: sum(file.stat().st_size for file in path.glob("*.csv"))  # noqa: E731
    chosen = {
        "healthy": [first(lambda effects: not effects)],
        "single": [first(inside(1), quick)],
        "pair": [first(inside(2))],
        "three": [min((path for path, effects in bench.items() if inside(3)(effects)), key=size)],
        "unknown": [cut(first(lambda effects: effects and not set(effects) & known), "unknown", 5)],
    }
    chosen["thin"] = [cut(chosen["single"][0], "thin", 2)]
    if "drive" not in without:
        road = drawn(work / "road", "--road", "--cars", "1")
        bench |= road
        chosen["drive"] = list(road)
    chosen["fleet"] = [path for path, effects in quick.items() if set(effects) <= known][:3]
    if recordings:
        # The page of a fleet calls its campaigns by their folders.
        chosen = {case: [cut(path, f"{case}/{path.name}", recordings) for path in paths] for case, paths in chosen.items()}
    return {case: [(path, bench[path]) for path in paths] for case, paths in chosen.items() if case not in without}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--without", nargs="*", default=[], choices=CASES)
    parser.add_argument("--recordings", type=int, help="take only so many recordings of each campaign, the first: quicker, and less sure")
    asked = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as work:
        for case, campaigns in choose(Path(work), asked.without, asked.recordings).items():
            out = asked.out / case
            paths = [str(path) for path, _ in campaigns]
            subprocess.run([COMMAND, "diagnose", *paths, "--out", str(out)], check=True, capture_output=True)
            for path, effects in campaigns:
                report = (out / path.name if len(campaigns) > 1 else out) / "report.html"
                title = report.read_text(encoding="utf-8").split("<title>")[1].split("</title>")[0]
                link = html.escape(report.relative_to(asked.out).as_posix())
                rows.append(f'<tr><th scope="row"><a href="{link}">{case}</a></th><td>{", ".join(effects).replace("_", "_<wbr>") or "nothing"}</td><td>{title.split(": ", 2)[-1]}</td></tr>')
                print(f"{case}: {', '.join(effects) or 'nothing'} -> {html.unescape(title)}")
    (asked.out / "index.html").write_text(PAGE.format(seed=SEED, rows="\n".join(rows)), encoding="utf-8")


if __name__ == "__main__":
    main()
