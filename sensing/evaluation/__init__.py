"""Errors of wrench models, measured through the pipeline that users run."""
