"""Simulation of a program on the machine: figures and motion."""
