"""Settings found in drives before the first write: saving and restoring."""
