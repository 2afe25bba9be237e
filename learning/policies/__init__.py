"""Policies: from what is felt at a fragment's start to offsets of the drives' targets."""
