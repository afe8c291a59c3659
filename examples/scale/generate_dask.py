"""A data set by Dask: a task for each part.

    python generate_dask.py rooms.toml rooms 20

Dask's workers start here, on this computer's cores (or WORKERS of them); on a cluster DASK_SCHEDULER_ADDRESS is where
its scheduler is, and the folder has to be one that all workers see. A task whose worker dies is run again by another
one; a shard's folder is there or not there, so nothing is made twice.
"""

import os
import sys

import sonard
from dask.distributed import Client, LocalCluster


def make(spec: str, out: str, number: int, parts: int) -> int:
    # One thread: Dask has a task for each core.
    return sonard.generate(spec, out, part=(number, parts), threads=1)["generated"]


def main() -> None:
    spec, out, parts = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2]), int(sys.argv[3])
    workers = int(os.environ.get("WORKERS", os.cpu_count() or 1))
    cluster = os.environ.get("DASK_SCHEDULER_ADDRESS") or LocalCluster(
        n_workers=workers, threads_per_worker=1, dashboard_address=None
    )
    with Client(cluster) as client:
        # Not pure: a task makes folders, and is no value that Dask could keep.
        tasks = [
            client.submit(make, spec, out, number, parts, pure=False, retries=3) for number in range(1, parts + 1)
        ]
        client.gather(tasks)
    # Who was last may not have seen that it was.
    print(sonard.generate(spec, out))


if __name__ == "__main__":
    main()
