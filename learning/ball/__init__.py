"""Trajectory optimisation of arms and ball (P1 5.1): methods that find cycle after cycle of offsets with
which hands really play."""
