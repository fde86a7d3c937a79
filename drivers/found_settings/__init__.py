"""What drives held before anything was written to them: kept, and put back."""
