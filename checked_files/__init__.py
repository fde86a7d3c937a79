"""Files that users write, as validated models with line numbers in their errors."""
