"""Load-displacement files of bond tests to statistics and plots."""
