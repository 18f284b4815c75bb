"""Core models of a machine: controller, modes, drives; and simulation of programs on them."""
