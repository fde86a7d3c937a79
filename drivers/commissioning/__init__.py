"""All or nothing: what a drive must offer, is asked, and is configured to, before any moves."""
