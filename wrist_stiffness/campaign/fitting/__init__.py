"""Fit the parameters of a model to measured sessions: calibrate, extend, judge."""
