"""What is said while one waits is true."""

import pytest

from warpdribble.commands.console import compiling
from warpdribble.sims.worlds import batch


@pytest.mark.parametrize("modules", [0, 1, 3])
def test_compiling_is_said_once_and_only_where_it_happens(capsys, modules):
    with compiling():
        for _ in range(modules):
            for told in batch._TOLD:
                told()
    said = capsys.readouterr()
    assert said.err.count("compiling kernels") == said.err.count("\n") == min(modules, 1) and not said.out
    assert not batch._TOLD
