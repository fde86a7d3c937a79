"""Methods set against one another on many virtual plants whose truth is known."""
