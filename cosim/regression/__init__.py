"""Scenarios as tests: limits and goldens, in processes that may crash or hang, with verdicts for
people, for build servers and for pytest.
"""
