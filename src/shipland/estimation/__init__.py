"""Estimators that know no camera and no vehicle."""
