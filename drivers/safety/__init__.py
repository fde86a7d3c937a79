"""Supervision of the axes by samples: reasons to stop, independent of the drives."""
