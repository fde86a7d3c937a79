"""Plant on a bus: as an interface of python-can, or served on any other bus."""
