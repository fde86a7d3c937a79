"""Object dictionaries, of data sheets and of live drives, and what they offer for measuring."""
