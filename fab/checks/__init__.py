"""Checks that gate an export, measured on the files as written."""
