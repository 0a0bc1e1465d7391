"""Scenario files: what may stand in them (`schema`) and how they are read (`load`)."""
