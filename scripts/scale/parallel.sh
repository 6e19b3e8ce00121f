#!/bin/sh
# All shards of a run under GNU parallel, on this machine or, with --sshlogin, on others that share the folders.
# Usage: as shard.sh, plus further options of parallel as arguments.
set -eu
scale=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$OUT"
seq 0 $((SHARDS - 1)) | parallel --retries 3 --halt never "$@" "$scale/shard.sh" {}
