"""What the command line shows and asks, apart from the commands themselves (`hil.cli`)."""
