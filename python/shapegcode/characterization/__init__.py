"""Measures what a controller does with blocks: writes test programs, and fits the machine file to their results.

* ``plan``: what a test is, and its box; ``timing``: how long it lasts; ``tests``: which are drawn up for a machine;
  ``programs``: them as FANUC programs with instructions; ``sheet``: ``RESULTS.toml``;
* ``stopwatch`` and ``rapidwatch``: fit to stopwatch times;
* ``log``: reads servo logs; ``hold`` and ``moves``: single moves in them; ``logfit``, ``shapefit``, ``servofit``:
  fit to logs;
* ``facts``: what was found, from one or both; ``characterize``: all of it, and the machine file; ``result``: how it is
  shown.
"""
