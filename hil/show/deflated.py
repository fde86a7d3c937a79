"""Compression of data for HTML."""

from __future__ import annotations

import base64
import gzip
import json


def deflate(data: object) -> str:
    """Return compressed JSON of `data`, as text safe in HTML."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode()
