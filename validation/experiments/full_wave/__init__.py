"""Our simulator and our estimator against full-wave solutions."""
