"""Identifies a controller's parameters: writes test programs, and fits the machine file to their results."""
