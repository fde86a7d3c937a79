"""Results of an estimate: model file, report, comparison with a known truth."""
