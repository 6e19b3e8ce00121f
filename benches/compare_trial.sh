#!/bin/sh
# One Monte Carlo trial of this program beside the same in NumPy and Pinocchio, and what bounds it, as Markdown.
# Needs: cargo, python3 with `pip install pin numpy`. PROFILE=dev times the optimised development build instead of the release one.
set -eu
cd "$(dirname "$0")/.."
profile="${PROFILE:-release}"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cargo run --quiet --profile "$profile" --bin armid -- simulate --out "$folder/log.csv" >&2
cargo run --quiet --profile "$profile" --example trial_profile -- 31 > "$folder/profile.json"
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1 python3 benches/numpy_trial.py "$folder/log.csv" "$folder/profile.json"
