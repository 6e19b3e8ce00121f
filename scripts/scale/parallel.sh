#!/bin/sh
# All shards of a run under GNU parallel, on this machine or, with --sshlogin, on others that share the folders.
# Usage: as shard.sh, plus further options of parallel as arguments.
set -eu
scale=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$OUT"
# Other machines get neither the environment that describes the run nor the folder in which it was started, unless told.
seq 0 $((SHARDS - 1)) | parallel --retries 3 --halt never --workdir . \
  --env SCENARIO --env TRIALS --env SHARDS --env OUT --env MONTECARLO "$@" "$scale/shard.sh" {}
