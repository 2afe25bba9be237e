"""Runs on disk: folders, logs, whole files."""
