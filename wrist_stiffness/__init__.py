"""Online error compensation of a flexible 2-DOF spherical parallel wrist."""

import os

__version__ = "0.1.0"

# Before anything loads numpy.  Matrices here have tens to hundreds of rows: threads below them gain
# nothing on an idle machine and wait for each other on a busy one, where an eigenvalue problem of
# 860 rows took 20 s instead of 0.1.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
