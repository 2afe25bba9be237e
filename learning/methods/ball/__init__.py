"""Trajectory optimisation of arms and ball (P1 5.1): three methods that find cycle after cycle of offsets under
which the hands really play with the ball."""
