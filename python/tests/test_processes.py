"""Threads, forked processes, interrupts and memory."""

import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import sonard

from .conftest import places_in

SCENE = sonard.Scene.shipped("simple-room")
MODEL = sonard.Model(SCENE, max_range_m=3.0)
POSES = places_in(SCENE, 20)
PATIENCE_S = 60


def in_a_fork_of(compute: Callable[[], bytes]) -> bytes:
    """Returns the result of `compute` in a forked child."""
    context = multiprocessing.get_context("fork")
    queue = context.Queue()

    def answer(queue: "multiprocessing.Queue[bytes]") -> None:
        queue.put(compute())

    with warnings.catch_warnings():
        # Python warns that forks of threaded programs may hang: this one must not.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = context.Process(target=answer, args=(queue,))
        child.start()
    try:
        return bytes(queue.get(timeout=PATIENCE_S))
    finally:
        child.kill()
        child.join()


def fork_and_predict() -> bytes:
    return in_a_fork_of(lambda: MODEL.predict(POSES).tobytes())


def test_fork_after_use() -> None:
    expected = MODEL.predict(POSES, threads=2).tobytes()
    for _ in range(5):
        assert fork_and_predict() == expected
    assert MODEL.predict(POSES).tobytes() == expected


def test_fork_during_prediction() -> None:
    expected = MODEL.predict(POSES).tobytes()
    done = threading.Event()

    def predict() -> None:
        while not done.is_set():
            MODEL.predict(POSES, threads=2)

    others = [threading.Thread(target=predict) for _ in range(3)]
    for other in others:
        other.start()
    try:
        for _ in range(5):
            assert fork_and_predict() == expected
    finally:
        done.set()
        for other in others:
            other.join()


def test_spawned_process() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(MODEL.predict, (POSES,)).tobytes() == MODEL.predict(POSES).tobytes()


def test_threads_share_model() -> None:
    expected = [MODEL.predict(pose).tobytes() for pose in POSES]
    with ThreadPoolExecutor(8) as pool:
        assert [found.tobytes() for found in pool.map(MODEL.predict, POSES)] == expected


def test_releases_interpreter_lock() -> None:
    ticks = 0
    done = threading.Event()

    def count() -> None:
        nonlocal ticks
        while not done.wait(0.001):
            ticks += 1

    counting = threading.Thread(target=count)
    counting.start()
    began = time.monotonic()
    while time.monotonic() - began < 0.5:
        MODEL.predict(POSES, threads=1)
    done.set()
    counting.join()
    # With the interpreter lock held there would be one at each return: a dozen or two.
    assert ticks > 60


def test_interrupt() -> None:
    program = (
        # A script that runs in the background would ignore it.
        "import sonard, numpy, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "poses = numpy.tile([0.4, 0.3, 0.0], (200_000, 1))\n"
        "print('began', flush=True)\n"
        "try: sonard.Model('simple-room').predict(poses, threads=1)\n"
        "except KeyboardInterrupt: sys.exit(7)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
    try:
        assert child.stdout is not None and child.stdout.readline() == b"began\n"
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        assert child.wait(PATIENCE_S) == 7
    finally:
        child.kill()
        child.wait()
        assert child.stdout is not None
        child.stdout.close()


def resident_bytes() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="memory is read from Linux's /proc")
def test_memory_is_constant() -> None:
    def use(times: int) -> None:
        for _ in range(times):
            readings = MODEL.predict(POSES)
            assert readings.size == 8000
            MODEL.reading(POSES[0])
            MODEL.paths(POSES[0], min_amplitude=0.1)
            with pytest.raises(sonard.PoseError):
                MODEL.predict([9, 9, 9])

    use(25)
    gc.collect()
    before = resident_bytes()
    use(125)
    gc.collect()
    assert resident_bytes() - before < 4 << 20


def test_memory_error() -> None:
    # A view of a single pose, so that only the result is large.
    poses = np.broadcast_to([0.4, 0.3, 0.0], (1_000_000, 3))
    with pytest.raises(MemoryError, match="pass fewer poses per call"):
        MODEL.predict(poses, np.zeros(50_000_000))
