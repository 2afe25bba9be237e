"""Learning to dribble: one file per method, each readable beside its paper."""
