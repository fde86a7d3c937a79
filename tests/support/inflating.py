"""Decompression of the data in pages."""

import base64
import gzip
import json


def inflated(text: str) -> object:
    """Return the original of data packed by `hil.show.html.deflate`."""
    return json.loads(gzip.decompress(base64.b64decode(text)))
