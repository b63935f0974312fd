"""The workbench: a page over `analysis.Analysis`; what is inferred is inferred there."""
