"""Kernel benchmarks, each beside a peer on the same model in the same run: `warpdribble bench step`."""
