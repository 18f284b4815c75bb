"""Conversion of a program to its shaped program, with verdict."""
