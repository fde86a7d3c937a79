"""Live display of a run in separate processes.

The process that moves the robot writes lines without waiting (`feed`, `listener`); displays are
processes of their own (`page_server`), which may hang or die without consequence.
"""
