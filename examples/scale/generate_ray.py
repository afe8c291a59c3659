"""A data set by Ray: a task for each part.

    python generate_ray.py rooms.toml rooms 20

Ray starts here, on this computer's cores (or with WORKERS workers); on a cluster RAY_ADDRESS is its address,
and the folder has to be one that all nodes see. A task whose worker dies is run again; a shard's folder is there or not
there, so nothing is made twice.
"""

import os
import sys

os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")

import ray
import sonard


@ray.remote(num_cpus=1, max_retries=3)
def make(spec: str, out: str, number: int, parts: int) -> int:
    # One thread: Ray has a task for each core.
    return sonard.generate(spec, out, part=(number, parts), threads=1)["generated"]


def main() -> None:
    spec, out, parts = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2]), int(sys.argv[3])
    workers = None if "RAY_ADDRESS" in os.environ else int(os.environ.get("WORKERS", os.cpu_count() or 1))
    ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False)
    ray.get([make.remote(spec, out, number, parts) for number in range(1, parts + 1)])
    # Who was last may not have seen that it was.
    print(sonard.generate(spec, out))


if __name__ == "__main__":
    main()
