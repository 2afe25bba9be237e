"""warpdribble: physics-based basketball dribbling for character animation.

    from warpdribble import Model, Simulation
    sim = Simulation(Model.load("player"), world_count=256)

Importing this package loads nothing heavy; the public names load theirs on first use.
"""

from pathlib import Path as _Path
from typing import TYPE_CHECKING

from .lazy import lazily

if TYPE_CHECKING:
    from .sims import Model, Simulation

__version__ = "0.1.0"

# In a checkout the sub-packages lie beside this folder, not in it.
_here = _Path(__file__).resolve().parent
_beside = (_here.parent / "kernels" / "__init__.py").is_file()
if __name__ == "warpdribble" and _beside and not (_here / "kernels").is_dir():
    __path__.append(str(_here.parent))

__all__ = ["Model", "Simulation", "__version__"]

__getattr__, __dir__ = lazily(__name__, {".sims": "Model Simulation"})
