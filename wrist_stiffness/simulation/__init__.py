"""The virtual cell: a true wrist whose laws the error model does not share.

Conventions as in `mechanism`: SI units, 6-vectors at O in F, `theta` (..., 2) motor angles.  A
block is a run of n samples in the order of time; histories go on from block to block, so blocks of
any length give the same samples.
"""
