"""What a page holds beside what it shows."""

import json
import re
from pathlib import Path
from typing import Any

PIECE = re.compile(r'<script type="application/json" id="(\w[\w-]*)">(.*?)</script>', re.DOTALL)


def pieces(page: Path) -> dict[str, Any]:
    """The JSON in a page, by the ids of its elements."""
    return {name: json.loads(text) for name, text in PIECE.findall(page.read_text())}
