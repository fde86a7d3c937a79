"""Output and questions of the command line, apart from the commands (`hil.cli`)."""
