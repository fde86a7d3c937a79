"""Base parameters and friction from motions that somebody else recorded.

Nothing is known of such a motion beforehand: not its set-points, not its noise, not how friction
behaves. So what others choose by hand is chosen by the data, by rules that are stated with the
result: cut-off frequency and source of velocities (`settings`), the law of friction and the dead
zone (`choice`), the latter two by the error of prediction on blocks that were held out, and so is
whether friction changed its level meanwhile (`drift`). Recordings are condensed one after the other
(`accumulation`) to blocks of inner products of named columns (`columns`) of filtered motion
(`motion`); samples are never all in memory at once. All else is a regression over these blocks
(`hil.least_squares.regression`). The methods by name are in `hil.estimation.free_motion_methods`.

Standard errors add up two things: what differs from one block of time to the next, and what differs
from one part of the space of states to the next, which is where an incomplete model shows; the
default method adds what other laws would have found (`choice`).
"""
