"""Who is given some of the cores simulates on those."""

import os
import subprocess
import sys

import pytest

from warpdribble.sims.worlds.cores import usable_cores


def test_there_is_one():
    assert 1 <= usable_cores() <= os.cpu_count()


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system gives cores to no one")
def test_cores_that_were_not_given_are_not_used():
    own = sorted(os.sched_getaffinity(0))
    code = (
        f"import os; os.sched_setaffinity(0, [{own[0]}]);"
        "from warpdribble.sims.worlds.cores import usable_cores; print(usable_cores())"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["1"]
