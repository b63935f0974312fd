"""From FEM readouts to a lookup table: platform error, biharmonic spline, table file."""
