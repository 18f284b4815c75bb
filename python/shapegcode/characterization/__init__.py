"""Measures what a controller does with blocks: writes test programs, and fits the machine file to their results."""
