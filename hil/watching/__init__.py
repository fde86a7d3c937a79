"""Measured torque against the model's, sample by sample, while axes move."""
