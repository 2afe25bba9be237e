"""One smooth body over the player's shapes."""
