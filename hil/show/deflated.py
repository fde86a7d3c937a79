"""Data as text that HTML may hold."""

from __future__ import annotations

import base64
import gzip
import json


def deflated(data: object) -> str:
    """Return JSON of `data`, compressed, as text that HTML may hold."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode()
