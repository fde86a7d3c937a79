"""Drive profile CiA 402: the behaviour of a servo drive."""
