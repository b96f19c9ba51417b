"""The licences of every crate that is linked in: the list, and whether it holds.

    python3 packaging/licences.py            writes packaging/licenses/crates.txt, the crates of the command
    python3 packaging/licences.py --check    compares it, and third-party.txt, which goes into the FMUs, with Cargo.lock

Every crate has to offer a licence that deny.toml allows; those of the FMUs have to offer MIT's, whose text goes with them.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "packaging" / "licenses"


def linked(*features):
    """Name, version and licence of every crate that the package is linked with: no build and no test dependencies."""
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", "x86_64-unknown-linux-gnu", *features]
    found = json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout)
    packages = {package["id"]: package for package in found["packages"]}
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    root = next(id for id, package in packages.items() if package["name"] == "kisspoint")
    seen, waiting = set(), [root]
    while waiting:
        id = waiting.pop()
        if id in seen:
            continue
        seen.add(id)
        # A macro runs in the compiler, and so does what it needs.
        if any("proc-macro" in target["kind"] for target in packages[id]["targets"]):
            seen.discard(id)
            continue
        waiting += [dep["pkg"] for dep in nodes[id]["deps"] if any(kind["kind"] is None for kind in dep["dep_kinds"])]
    ours = {"kisspoint", "realcar"}
    return sorted({(p["name"], p["version"], p["license"] or "none") for p in map(packages.get, seen) if p["name"] not in ours})


def offers(expression, allowed):
    """Whether an SPDX expression can be met with these licences."""
    tokens = re.findall(r"[()]|AND|OR|[\w.+-]+(?: WITH [\w.-]+)?", expression.replace("/", " OR "))
    words = {"AND": "and", "OR": "or", "(": "(", ")": ")"}
    return eval(" ".join(words.get(token, str(token in allowed)) for token in tokens))


def main(check):
    allowed = set(tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))["licenses"]["allow"])
    command, library = linked(), linked("--no-default-features")
    faults = [f"{name} {version}: {licence} is not allowed by deny.toml" for name, version, licence in command if not offers(licence, allowed)]
    faults += [f"{name}: {licence} does not offer MIT's, which the FMU states" for name, _, licence in library if not offers(licence, {"MIT"})]
    width = max(len(name) for name, _, _ in command)
    text = "The command is linked with the Rust standard library (MIT OR Apache-2.0) and with these crates.\nMade by packaging/licences.py.\n\n"
    text += "".join(f"{name:<{width}}  {licence}\n" for name, licence in sorted({(name, licence) for name, _, licence in command}))
    list_of_command = FOLDER / "crates.txt"
    if not check:
        list_of_command.write_text(text, encoding="utf-8")
    elif list_of_command.read_text(encoding="utf-8") != text:
        faults.append("packaging/licenses/crates.txt is out of date: run python3 packaging/licences.py")
    rows = [re.split(r"\s{2,}", line)[:2] for line in (FOLDER / "third-party.txt").read_text(encoding="utf-8").splitlines() if "    " in line]
    stated, real = {name: licence for name, licence in rows if name != "Rust standard library"}, {name: licence for name, _, licence in library}
    if stated != real:
        faults.append(f"packaging/licenses/third-party.txt states {sorted(stated.items() - real.items())}, the library has {sorted(real.items() - stated.items())}")
    print("\n".join(faults) or f"{len(command)} crates in the command, {len(library)} in the library of the FMUs: every licence is allowed and listed")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
