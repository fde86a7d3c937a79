"""Drive profile CiA 402: states, set-points, samples, power-on, stop, power-off."""
