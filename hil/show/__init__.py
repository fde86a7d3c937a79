"""What commands found, written on a terminal, as a page, in a notebook and as JSON: each once."""
