"""Writers of identified models in file formats of other tools; `formats` lists the formats."""

from hil.callable_package import make_callable

make_callable(__name__)
