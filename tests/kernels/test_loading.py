"""Compiled kernels are found again by the next process."""

import os
import subprocess
import sys

import pytest

COMPILES = """
import warp as wp
from warpdribble import kernels
from warpdribble.kernels.loading import SHARING

kernels.program(1, "probe").load(wp.get_device("cpu"))
for name in SHARING:
    print("named", wp.get_module(kernels.program(1, name).__name__).get_module_identifier(1))
"""


@pytest.mark.slow
def test_kernels_have_the_same_names_whatever_was_compiled_before(tmp_path):
    """Warp hashes what compiling changes: names that were asked for too late made the second process compile
    what the first one had, and the third."""
    environment = os.environ | {"WARP_CACHE_PATH": str(tmp_path)}
    said = [
        subprocess.run(
            [sys.executable, "-c", COMPILES], env=environment, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    cold, warm = ([line for line in text.splitlines() if line.startswith("named")] for text in said)
    assert "(compiled)" in said[0] and "(compiled)" not in said[1]
    assert len(cold) == 6 and cold == warm
