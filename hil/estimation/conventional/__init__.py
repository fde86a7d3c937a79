"""Conventional identification (section 5 of the paper): one regression over exciting trajectories.

All joints move at once, and the base parameters come from Q = A(q, qd, qdd) p + friction in one
linear fit, eq. (11). Variants differ in how friction is treated (`friction_terms`), how rows are
weighted and how the overdetermined system is solved (`solution`); `variants` names those that the
literature proposes, and the strongest that we can build. Nothing here assumes that friction changes
in the course of the measurement, since none of these methods does.
"""
