"""Live display of a run in separate processes.

The process that moves the robot writes lines without waiting (`feed`, `listener`); displays are
separate processes (`page_server`), which may hang or die without consequence.
"""
