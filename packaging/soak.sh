#!/usr/bin/env bash
# The FMUs under load for a given time: both tests of tests/load.rs, half of the time each.
#
#   packaging/soak.sh [SECONDS]      an hour unless said otherwise
set -euo pipefail
cd "$(dirname "$0")/.."
KISSPOINT_SOAK_S=$((${1:-3600} / 2)) exec cargo test --profile quick --test load -- --nocapture --test-threads 1
