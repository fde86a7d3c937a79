"""Data on disk: recordings, run folders, their journals. Nothing moves here."""
