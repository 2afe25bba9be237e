"""A short way of learning locomotion."""

from warpdribble.learning.methods.samcon import SamconConfig
from warpdribble.learning.tasks.disturbance import Disturbance

ISLANDS, PARTICLES = 4, 16
SMALL = SamconConfig(
    iterations=4,
    islands=ISLANDS,
    particles=PARTICLES,
    walk=40,
    lag=5,
    open_loop=1,
    check_every=2,
    trials=16,
    disturbance=Disturbance(push=100.0, arms=0.1, hands=10.0),
)
