"""Data sets for training: runs that the loop drives itself by a recipe, one Parquet file each."""

from cosim.dataset.sensorless import NoSensor

__all__ = ["NoSensor"]
