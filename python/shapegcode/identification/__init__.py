"""Vibration modes from taps, decays, sweeps and captures; SI units throughout: s, N, m/s², kg."""
