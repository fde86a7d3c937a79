"""Virtual twin of any robot: a plant file and a drives file from its robot file."""
