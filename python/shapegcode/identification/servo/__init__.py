"""Fit models of the position loop to a log of commands and actual positions."""
