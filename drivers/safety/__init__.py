"""What stops all axes for what the samples show, whatever the drives make of it."""
