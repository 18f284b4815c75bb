"""Learns the clock of a machine from what it did: programs and the logs of their runs.

* ``played``: a program as the clock sees it; ``readings``: what the feeds of a log tell; ``observed``: a log laid
  beside its program; ``shown``: what the feeds of all runs show directly;
* ``families``: what the look-ahead of a control may look like, with the keys of the machine file;
* ``windows``: how far a model's clock runs apart from a log's;
* ``motion_fit``: acceleration, jerk, corner rule; ``function_fit``: tool changes, M codes, spindle, ways not known;
* ``predict``: what a model says of a run, and where it was held; ``learn``: all of it, chosen by runs left out;
* ``file_values``: the numbers of the machine file; ``result``: how it is shown.
"""
