"""Cycle time of programs, and calibration of its model."""
