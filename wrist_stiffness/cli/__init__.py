"""The command line: a thin shell that reads arguments, calls one workflow and prints its result."""

import os

# Matrices here have tens to hundreds of rows.  Threads below them gain nothing on an idle machine
# and wait for each other on a busy one: an eigenvalue problem of 860 rows took 20 s instead of 0.1.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
