"""warpdribble: physics-based basketball dribbling for character animation.

    from warpdribble import Model, Simulation
    sim = Simulation(Model.load("player"), world_count=256)

Importing this package loads nothing heavy; the public names load theirs on first use.
"""

from importlib import import_module as _import_module
from pathlib import Path as _Path

__version__ = "0.1.0"

# In a checkout the sub-packages lie beside this folder, not in it.
_here = _Path(__file__).resolve().parent
_beside = (_here.parent / "kernels" / "__init__.py").is_file()
if __name__ == "warpdribble" and _beside and not (_here / "kernels").is_dir():
    __path__.append(str(_here.parent))

_public = {"Model": ".sims", "Simulation": ".sims"}
__all__ = ["Model", "Simulation", "__version__"]


def __getattr__(name):
    if name in _public:
        return getattr(_import_module(_public[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted({*globals(), *__all__})
