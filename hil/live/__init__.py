"""A run as others see it while it goes on: what happens, passed to processes beside it.

The process that moves the robot writes lines and waits for nobody (`feed`, `listener`); whoever
shows them is a process of its own (`page_server`), which may hang or die as it likes.
"""
