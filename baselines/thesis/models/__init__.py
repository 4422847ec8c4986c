"""Errors of the linear models against the nonlinear truth."""
