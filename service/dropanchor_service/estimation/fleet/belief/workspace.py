"""What one thread works on: the unpacked hypotheses of one row, and scratch.

Fields are described as in `layout`, whose aliases `Hypothesis`, `Hypotheses`, `Scratch` and `Workspace` stand for them.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.fleet.belief.layout import FAMILIES, WORKING_HYPOTHESES, N

WORKING_HYPOTHESIS: Final = np.dtype(
    [
        ("log_weight", np.float64),
        ("heading_class", np.int32),
        ("nlos", np.int32),
        ("reverse", np.int32),
        ("los_bias", np.float64),
        ("los_bias_var", np.float64),
        ("mean", np.float64, (N,)),
        ("weight", np.float64),  # `summary.fill_positions` fills this and what follows
        ("direction", np.float64, (2,)),  # unit vector from the anchor
        ("position", np.float64, (2,)),  # m, from the anchor
        ("position_var", np.float64),  # m^2, without a common rotation about the anchor
        ("by_weight", np.int32),  # index of the k-th heaviest
        ("merged", np.bool_),  # into a heavier one
        ("in_mode", np.bool_),  # a member of the mode under consideration
        ("assigned", np.bool_),  # to a mode considered before
        ("cov", np.float64, (N, N)),
        ("delta", np.float64, (N,)),  # scratch of merging and splitting
    ],
    align=True,
)

SCRATCH: Final = np.dtype(
    [
        ("decay", np.float64, (N,)),
        ("growth", np.float64, (N,)),
        ("F", np.float64, (4, N)),
        ("FP", np.float64, (4, N)),
        ("H", np.float64, (N,)),
        ("PH", np.float64, (N,)),
        ("out", np.float64, (3,)),
        ("mean", np.float64, (5,)),
        ("cov", np.float64, (3, 3)),
        ("part", np.float64, (3, 3)),
        ("share", np.float64, (FAMILIES,)),
        ("point", np.float64, (3,)),
        ("causes", np.float64, (4, 4)),  # `parts` fills this and `radial`
        ("radial", np.float64, (2,)),
        ("lane", np.int64),  # whose free slots of the pool the thread takes
    ]
)

# All that one thread works on, as one record: compiled code counts no references to the parts of a record.
WORKSPACE: Final = np.dtype(
    [("hypotheses", WORKING_HYPOTHESIS, (WORKING_HYPOTHESES,)), ("scratch", SCRATCH)], align=True
)


def make_workspace(lane: int = 0) -> npt.NDArray[np.void]:
    """Return WORKSPACE (1,): for one thread, with room for the unpacked hypotheses of one row."""
    workspace = np.zeros(1, WORKSPACE)
    workspace["scratch"]["lane"] = lane
    return workspace
