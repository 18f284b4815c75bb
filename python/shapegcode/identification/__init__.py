"""Vibration modes from a tap test or from the decay after a rapid stop.

`read` makes records of files, `checks` looks for double hits and overload, `fit` finds the modes, `update` puts them
into a machine file. SI units throughout: s, N, m/s², kg.
"""
