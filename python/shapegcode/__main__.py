"""``python -m shapegcode``: the command."""

import sys

from shapegcode.cli import main

sys.exit(main())
