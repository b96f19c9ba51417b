#!/usr/bin/env bash
# Updates what the documentation shows of the program: the executed notebook and the pictures of the report, all of the bundled campaign, and the numbers that docs/importers.md
# quotes. Tests fail if any of them is out of date; each picture has the words of its verdict stored with it.
#
#   packaging/docs.sh               after packaging/test.sh, whose builds and Python environment it uses; needs Chromium with its driver
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
export KISSPOINT=${KISSPOINT:-$PWD/$target/quick/kisspoint}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$KISSPOINT" diagnose tests/data/campaigns/example --out "$work" >/dev/null
"$target/venv/bin/python" docs/pictures/report.py "$work/report.html"
"$target/venv/bin/python" tests/python/test_notebook.py
"$target/venv/bin/python" tests/python/test_quoted.py
git --no-pager diff --stat -- docs README.md
