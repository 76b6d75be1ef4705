"""First-order recursion on an even grid, as a triangular system with one band below its diagonal."""

from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray


def recur(pole: complex, forced: ArrayLike) -> NDArray[Any]:
    """Return y_k = pole · y_{k−1} + forced_k from rest, along the first axis of one column or of several."""
    forced = np.asarray(forced)
    is_complex = np.iscomplexobj(pole) or np.iscomplexobj(forced)
    columns = forced.astype(complex if is_complex else float).reshape(len(forced), -1)
    band = np.ones((2, len(columns)), order="F", dtype=columns.dtype)
    band[1] = -pole
    solve = scipy.linalg.lapack.ztbtrs if is_complex else scipy.linalg.lapack.dtbtrs
    return np.asarray(solve(band, columns, uplo="L", diag="U")[0]).reshape(forced.shape)
