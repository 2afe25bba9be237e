"""What a policy is worth: trials, pushes, recordings of it."""
