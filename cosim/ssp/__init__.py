"""The wiring of a scenario as a System Structure and Parameterization package, SSP 1.0."""
