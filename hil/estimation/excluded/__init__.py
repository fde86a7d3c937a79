"""Found, excluded, invisible: what recordings prove of all that may spoil an identification."""
