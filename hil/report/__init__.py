"""A run's report: one HTML file with its tables and charts; and pages of other commands."""

from hil.callable_package import make_callable

make_callable(__name__)
