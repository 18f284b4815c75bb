"""Calibrates the cycle-time model of a machine from run logs."""
