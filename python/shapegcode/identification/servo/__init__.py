"""A log of commands and actual positions held against the models of the position loop."""
