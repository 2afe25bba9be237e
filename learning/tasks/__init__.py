"""Control problems: what a policy feels, what it changes, what that costs, what it has to stand."""
