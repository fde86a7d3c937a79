"""Detection of external forces: measured against predicted torque, sample by sample."""
