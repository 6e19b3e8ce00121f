#!/usr/bin/env bash
# The constrained estimate beside Clarabel, on the same problems in one run: time, and the difference of the objectives.
# Needs: pip install pin numpy cvxpy clarabel. Clarabel's Rust crate is no dependency because its semidefinite cone needs BLAS.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --test all --no-run
python3 tests/golden/physical.py --print
cargo test --test all -- --nocapture --test-threads 1 a_solve_takes_milliseconds the_optimum_is_clarabels
