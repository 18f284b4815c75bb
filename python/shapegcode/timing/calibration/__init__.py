"""Calibrates the cycle-time model of a machine from logs of its runs."""
