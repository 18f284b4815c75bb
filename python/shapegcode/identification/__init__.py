"""Vibration modes from taps, decays, sweeps and captures; SI units (s, N, m/s², kg) where a name has no other."""
