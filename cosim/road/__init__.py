"""Roads: layouts as tracks, surfaces on top of them, OpenCRG files for the vehicle."""

from cosim.road.build import build_road
from cosim.road.errors import RoadError
from cosim.road.file import track_of_file
from cosim.road.surface import Bumps, Iso8608, Smooth, Surface
from cosim.road.track import Pose, Stop, Track
from cosim.road.tracks import TRACK_NAMES, load_track

__all__ = [
    "TRACK_NAMES",
    "Bumps",
    "Iso8608",
    "Pose",
    "RoadError",
    "Smooth",
    "Stop",
    "Surface",
    "Track",
    "build_road",
    "load_track",
    "track_of_file",
]
