"""Work in processes of its own: sent out, watched, and brought home or buried.

A crash or a hang of an FMU takes down the one process that runs it; what it was doing is known from
a journal that outlives it. Nothing heavy is imported here.
"""

from cosim.isolation.children import Children, Watch, WorkError
from cosim.isolation.death import Death, death_of
from cosim.isolation.journal import Journal

__all__ = ["Children", "Death", "Journal", "Watch", "WorkError", "death_of"]
