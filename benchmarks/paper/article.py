"""What the paper says, as data: values as printed, with what the extracted text lost put back."""

from __future__ import annotations

import numpy as np

COUNTS = {"gravity": 64, "inertia": 92, "coupling": 9}
"""Configurations, section 8."""
MASS, DISTANCE = 10.86, 0.140
"""Of the load [kg], and of its centre of mass from the hand wrist [m], section 8."""
TABLE_1 = """
Izz1
Ixx2 Ixz2 Iyy2 Izz2 sx2
Ixx3 Iyy3 Izz3 sy3 m3
Ixx4 Iyy4 Izz4 sz4 m4
Ixx5 Iyy5 Izz5 sy5 m5
Ixx6 Iyy6 Izz6 sz6 m6
""".split()
EQUATION_22 = """
Izz1 + Iyy2 + Iyy3 + l1^2 (m3 + m4 + m5 + m6)
Ixx2 - Iyy2 - l1^2 (m3 + m4 + m5 + m6)
Ixz2
Izz2 + l1^2 (m3 + m4 + m5 + m6)
sx2 + l1 (m3 + m4 + m5 + m6)
Ixx3 - Iyy3 + Iyy4 + 2 l2 sz4 + l2^2 (m4 + m5 + m6)
Izz3 + Iyy4 + 2 l2 sz4 + l2^2 (m4 + m5 + m6)
sy3 - sz4 - l2 (m4 + m5 + m6)
Ixx4 + Iyy5 - Iyy4
Izz4 + Iyy5
Ixx5 + Ixx6 - Iyy5
Izz5 + Ixx6
sy5 - sz6
Izz6
""".strip().splitlines()
TABLE_2 = """
1 2 6 8 9 10 11 12 13 14 | 3 9 11 12 13 14 | 9 11 12 13 14 | 10 11 13 14 | 12 13 | 14 |
| 4 7 8 9 11 12 13 14 | 7 8 9 11 12 13 14 | 11 13 14 | 12 13 | 14 | 5 8 13
| | 7 9 11 12 13 14 | 11 13 14 | 12 13 | 14 | 8 13
| | | 10 11 14 | | 14 | 13
| | | | 12 | | 13
| | | | | 14 |
""".strip().splitlines()
"""M_i1 to M_i6 and g_i, upper triangle: numbers of the parameters."""
GROUPS = {
    "gravity": (5, 8, 13),
    "diagonal": (1, 2, 4, 6, 7, 9, 10, 11, 12, 14),
    "off_diagonal": (3,),
}
TABLE_3 = {
    "A": np.array([
        32.015, -28.058, -2.187, 19.905, 48.491, 9.602, 13.313,
        -15.836, 0.0000, 0.0443, 0.2883, 0.1554, -0.1885, 0.3760,
    ]),
    "B": np.array([
        36.907, -33.782, -2.435, 22.565, 51.896, 16.331, 18.562,
        -23.244, -0.0895, 0.2198, 0.2274, 0.4381, -1.9983, 0.3980,
    ]),
    "change": np.array([
        4.892, -5.724, -0.247, 2.6597, 3.405, 6.7296, 5.2493,
        -7.408, -0.0895, 0.1755, -0.0609, 0.2826, -1.8097, 0.0220,
    ]),
    "expected": np.array([
        2.713, -2.713, 0, 2.713, 5.409, 5.786, 5.786, -7.885, 0.0, 0.0, 0.0, 0.0, -1.518, 0.0470,
    ]),
}  # fmt: skip
"""Rows of Table 3 as printed; its caption has A and B the wrong way round: B carries the load."""
