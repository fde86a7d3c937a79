"""Recordings that somebody else made, turned into run folders: whatever file they come in.

A map (`map_file`) states which column is what; readers give columns of numbers (`readers`,
`tables`), `to_si` turns them into SI on the joint side, `stamps` and `instants` into even
samples, `segments` into motions without a gap, and `plausibility` finds what contradicts itself
before anything is estimated. `importing` is the whole.
"""
