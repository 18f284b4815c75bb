"""Batch runs: a command on many programs and machines, in many processes, resumable."""

COMMANDS = ("convert", "time", "check", "feed", "measure", "simulate")
"""Commands for one program that can be run on many."""

WRITES = ("convert", "feed")  # commands that write a program
