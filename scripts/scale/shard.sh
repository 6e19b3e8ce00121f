#!/bin/sh
# One shard of a Monte Carlo run: see README.md. Usage: shard.sh K
# The run is described by the environment, the same for all shards:
#   MONTECARLO  the program                (montecarlo)
#   SCENARIO    scenario file              (required)
#   TRIALS      trials of the whole run    (required)
#   SHARDS      number of shards           (required)
#   OUT         folder for shard files     (required)
set -u
k=$1
"${MONTECARLO:-montecarlo}" --scenario "$SCENARIO" --trials "$TRIALS" --shard "$k/$SHARDS" \
  --out "$OUT" --resume --threads 1 > "$OUT/shard-$k.log" 2>&1
code=$?
# 3 is a finished shard whose few trials fail the calibration by themselves; the merged run decides.
[ "$code" -eq 3 ] && code=0
exit "$code"
