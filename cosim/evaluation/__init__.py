"""Recorded runs evaluated: which runs, estimators and conditions, in processes of their own."""
