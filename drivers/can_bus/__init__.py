"""CAN by python-can: opening, own interfaces, frame logs, and SYNC from the kernel."""
