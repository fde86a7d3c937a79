"""CAN as python-can has it: opening, interfaces and logs of our own, SYNC from the kernel."""
