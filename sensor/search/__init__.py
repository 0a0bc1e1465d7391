"""The Bayesian search over the network's shape: studies, trials, results."""
