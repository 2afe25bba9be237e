"""Measured parts of the docs, made by commands."""
