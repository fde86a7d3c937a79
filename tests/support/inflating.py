"""What pages carry, unpacked."""

import base64
import gzip
import json


def inflated(text: str) -> object:
    """Return what `hil.show.deflated.deflate` has packed."""
    return json.loads(gzip.decompress(base64.b64decode(text)))
