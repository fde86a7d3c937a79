"""Object dictionaries of data sheets and of live drives, and their review."""
