"""The player, the ball and the court: worlds that step, reset, observe and record."""

from .mjcf import ModelError
from .model import Model
from .simulation import Simulation

__all__ = ["Model", "ModelError", "Simulation"]
