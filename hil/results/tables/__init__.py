"""Results as tables: the value, how a terminal and a page draw it, and one file a subject.

Each table is made by one function, so that commands, notebooks and reports show the same figures
under the same names.
"""
