"""The network with carried state: one LSTM step per sample, on features that a vehicle engineer
would compute first.
"""
