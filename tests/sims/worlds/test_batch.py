"""Kernels are loaded once in a process, whoever asks: a second time takes away code that may be running."""

import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import warp as wp

from warpdribble import kernels
from warpdribble.sims.worlds import batch

ROOT = Path(__file__).resolve().parents[3]
AT_ONCE = """
from concurrent.futures import ThreadPoolExecutor
from warpdribble.sims import Model, Simulation
model = Model.load("player")
sims = [Simulation(model, 64, threads=1) for _ in range(2)]
with ThreadPoolExecutor(2) as pool:
    list(pool.map(lambda sim: [sim.step(5) for _ in range(20)], sims))
"""


def test_threads_that_ask_at_once_load_once():
    """And all of them wait until it is done."""
    loads, seen = [], []

    def load(device):
        time.sleep(0.05)
        loads.append(device)

    class Program(SimpleNamespace):
        __hash__ = object.__hash__

    program, device = Program(load=load), SimpleNamespace(alias="cpu")

    def ask():
        batch._load(program, device)
        seen.append(len(loads))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert loads == [device] and seen == [1, 1, 1, 1]


def test_kernels_are_cached_once_they_were_compiled(tmp_path, monkeypatch):
    program, device = kernels.program(1, "place"), batch.find_device("cpu")
    program.load(device)
    assert batch.cached(program, device)
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    assert not batch.cached(program, device)


def test_it_is_told_before_kernels_are_compiled_and_only_then(monkeypatch):
    order = []

    class Program(SimpleNamespace):
        __hash__ = object.__hash__

    old, new, other = (Program(load=lambda device: order.append("loads")) for _ in range(3))
    device = SimpleNamespace(alias="cpu")
    monkeypatch.setattr(batch, "cached", lambda program, device: program is old)
    with batch.telling(lambda: order.append("told")):
        for program in (old, new, new):
            batch._load(program, device)
    batch._load(other, device)
    assert order == ["loads", "told", "loads", "loads"]


@pytest.mark.slow
def test_first_steps_of_two_threads_at_once():
    """In fresh processes, where kernels are not loaded yet: two of 25 used to end in a segmentation fault."""
    for _ in range(12):
        assert subprocess.run([sys.executable, "-c", AT_ONCE], cwd=ROOT).returncode == 0
