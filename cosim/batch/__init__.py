"""Several scenarios in one command: found, checked before the first step of any, and run in
processes of their own.
"""

from cosim.batch.job import Ended, Job
from cosim.batch.plan import find_scenarios, plan
from cosim.batch.run_all import run_all

__all__ = ["Ended", "Job", "find_scenarios", "plan", "run_all"]
