"""Roads: layouts as tracks, surfaces on top of them, OpenCRG files for the vehicle."""

from cosim.road.build import build_road
from cosim.road.cobbles import Cobbles
from cosim.road.errors import RoadError
from cosim.road.file import track_of_file
from cosim.road.iso8608 import Iso8608
from cosim.road.obstacles import Bumps, Hump, Obstacle, Pothole
from cosim.road.surface import Smooth, Surface
from cosim.road.track import Pose, Stop, Track
from cosim.road.tracks import TRACK_NAMES, load_track

__all__ = [
    "TRACK_NAMES",
    "Bumps",
    "Cobbles",
    "Hump",
    "Iso8608",
    "Obstacle",
    "Pose",
    "Pothole",
    "RoadError",
    "Smooth",
    "Stop",
    "Surface",
    "Track",
    "build_road",
    "load_track",
    "track_of_file",
]
