#!/usr/bin/env python3
"""All shards of a run under Dask, three retries each.

Usage: SCENARIO=… TRIALS=… SHARDS=… OUT=… dask_shards.py [SCHEDULER_ADDRESS]
Without an address a cluster of two single-threaded workers is started on this machine. Needs `pip install dask distributed`.
"""

import os
import subprocess
import sys
from pathlib import Path

from dask.distributed import Client, as_completed

SCALE = Path(__file__).resolve().parent
RUN = {key: os.environ[key] for key in ("SCENARIO", "TRIALS", "SHARDS", "OUT")}
RUN["MONTECARLO"] = os.environ.get("MONTECARLO", "montecarlo")


def shard(k, run):
    """Runs shard k in the worker; a failure is an error, so that Dask tries again."""
    subprocess.run([SCALE / "shard.sh", str(k)], env=os.environ | run, check=True)
    return k


def main():
    Path(RUN["OUT"]).mkdir(parents=True, exist_ok=True)
    address = sys.argv[1] if len(sys.argv) > 1 else None
    local = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with Client(address) if address else Client(**local) as client:
        futures = [client.submit(shard, k, RUN, retries=3, pure=False) for k in range(int(RUN["SHARDS"]))]
        for future in as_completed(futures):
            print(f"shard {future.result()} done", flush=True)


if __name__ == "__main__":
    main()
