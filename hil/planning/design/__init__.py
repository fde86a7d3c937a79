"""Plans chosen by counts, by minutes, for friction, and for conventional identification."""
