#!/usr/bin/env python3
"""Prints the tables of docs/evidence/arena.md, bench.md and corridor.md.

    python3 docs/reality SONARD DATA OUT [PART...]

SONARD is the built program, DATA the folder with the measurements (docs/reality-method.md has their sources), OUT a
folder for logs, calibrations and pictures. PART is one of arena, bench, corridor; all of them without it. Needs nothing
but Python, and takes some minutes. Tables are printed as Markdown.
"""

import sys

import arena
import bench
import corridor
from work import Work

PARTS = {"arena": arena.main, "bench": bench.main, "corridor": corridor.main}


def main():
    if len(sys.argv) < 4 or not set(sys.argv[4:]) <= set(PARTS):
        sys.exit(__doc__.strip())
    work = Work(*sys.argv[1:4])
    for part in sys.argv[4:] or PARTS:
        PARTS[part](work)


if __name__ == "__main__":
    main()
