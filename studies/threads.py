"""One thread for linear algebra: the matrices are small, threads cost more than they bring; and the same digits everywhere."""

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
