"""Measures what a controller does with blocks: writes test programs, and fits the machine file to their results.

* ``plan``: what the tests do; ``timing``: how long that lasts; ``programs``: the tests as FANUC programs;
* ``results``: ``RESULTS.toml`` and the operator's instructions;
* ``stopwatch``: fit to stopwatch times; ``log``: reads servo logs; ``moves``: the shape of single moves in a log;
  ``logfit``, ``rapidfit``, ``servofit``: fit to logs; ``fit``: findings, from one or both, and the machine file with
  them.
"""
