"""What a plan will give, before anything moves: noise, identifiability, precision."""
