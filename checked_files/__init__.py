"""Files written by users, as validated models with line numbers in errors."""
