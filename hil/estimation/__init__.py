"""From recordings to base parameters with their uncertainty. No files, no terminal, no bus."""
