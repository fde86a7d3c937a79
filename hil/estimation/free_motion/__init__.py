"""Base parameters and friction from imported free motions.

Set-points, noise and friction of an imported motion are unknown. Settings usually chosen by hand
are therefore chosen by the data, by rules stated with the result: cut-off frequency and velocity
source (`settings`), friction law and dead zone (`choice`), the latter two by the prediction error
on held-out blocks, as is the drift of the friction level (`drift`). Recordings are condensed one
after another (`accumulation`) to blocks of inner products of named columns (`columns`) of filtered
motion (`motion`); samples of all recordings are never in memory at once. Everything else is a
regression over these blocks (`hil.least_squares.regression`). The methods by name are in
`hil.estimation.import_methods`.

Standard errors add two contributions: differences between blocks of time, and differences between
regions of the state space, where an incomplete model shows; the default method adds the differences
between friction laws (`choice`).
"""
