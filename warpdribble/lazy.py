"""Public names of a package that load the module behind them on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any


def lazily(package: str, modules: dict[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package. modules: module, relative to the package -> public names that
    stand in it."""
    names = {name: module for module, several in modules.items() for name in several.split()}

    def getattr_(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = import_module(names[name], package)
        try:
            value = getattr(module, name)
        except AttributeError:  # the name is that of a module
            value = import_module(f"{names[name]}.{name}", package)
        setattr(sys.modules[package], name, value)
        return value

    return getattr_, lambda: sorted({*vars(sys.modules[package]), *names})
