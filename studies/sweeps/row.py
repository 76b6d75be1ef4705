"""What became of one design of a study."""

from typing import NamedTuple


class Row(NamedTuple):
    """What became of a case: `remark` is the reason of a failure, or a warning of the solver."""

    status: str
    remark: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    seconds: float
