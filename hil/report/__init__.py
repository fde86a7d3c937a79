"""Report of a run: one HTML file with tables and charts; also pages of other commands."""

from hil.callable_package import make_callable

make_callable(__name__)
