"""Learns the clock of a machine from what it did: programs and the logs of their runs.

* ``observed``: a log laid beside its program: when each line began, overrides, holds;
* ``families``: what the look-ahead of a control may look like, with the keys of the machine file;
* ``windows``: how far a model's clock runs apart from a log's;
* ``motion_fit``: acceleration, jerk, corner rule; ``function_fit``: tool changes, M codes, spindle, ways not known;
* ``learn``: all of it, chosen by runs left out; ``result``: how it is shown.
"""
