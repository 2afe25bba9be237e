"""How many processor cores there are to work on."""

import os


def usable_cores() -> int:
    """Those that this process may use: all, or the ones that it was given, as by taskset or by what runs jobs
    on a cluster."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS, nor on Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
