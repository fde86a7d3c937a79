"""Found, excluded and invisible causes: proof by recordings of errors in an identification."""
