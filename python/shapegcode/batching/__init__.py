"""Batch runs: a command on many programs and machines, in many processes, resumable."""
