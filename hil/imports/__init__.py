"""Import of foreign recordings, in any file format, into run folders.

A map (`map_file`) states the meaning of columns; readers give columns of numbers (`readers`,
`tables`), `to_si` converts to SI on the joint side, `stamps` and `instants` find even samples,
`segments` finds motions without a gap, and `plausibility` finds contradictions before the
estimation. `importing` combines all steps.
"""
