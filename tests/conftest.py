"""What holds for every test: one thread for linear algebra, since the solver's matrices are small."""

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")
