#!/bin/sh
# Times the dynamics of this program and of Pinocchio back to back and prints one table.
# Needs: cargo, python3 with `pip install pin numpy`.
set -eu
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-target}"
cargo bench --quiet --bench dynamics >&2
OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1 python3 benches/pinocchio_times.py "$target"
