"""Kalman filters for the suspension velocities, designed on the linearised vehicle FMU."""
