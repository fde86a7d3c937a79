"""Results of commands on a terminal, as a page, in a notebook and as JSON."""
