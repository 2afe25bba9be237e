import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def pytest_collection_modifyitems(items):
    on_gpu = [item for item in items if item.get_closest_marker("gpu")]
    if on_gpu:
        import warp as wp

        if not wp.is_cuda_available():
            for item in on_gpu:
                item.add_marker(pytest.mark.skip(reason="no CUDA device"))


@pytest.fixture(scope="session")
def mocap() -> Path:
    """Folder of recorded clips: $WARPDRIBBLE_DATA, else shared/mocap beside the checkout."""
    folder = Path(os.environ.get("WARPDRIBBLE_DATA") or ROOT.parent / "shared" / "mocap")
    if not folder.is_dir():
        pytest.skip("no recorded clips: set WARPDRIBBLE_DATA to their folder")
    return folder
