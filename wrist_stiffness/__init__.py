"""Online error compensation of a flexible 2-DOF spherical parallel wrist."""

__version__ = "0.1.0"
