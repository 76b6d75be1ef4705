"""What holds for every test: one thread for linear algebra, since the solver's matrices are small, and a heap that is swept once."""

import gc
import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def pytest_collection_finish() -> None:
    """All modules and tests are loaded for good: later sweeps of the collector leave them out."""
    gc.collect()
    gc.freeze()
