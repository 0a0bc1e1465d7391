"""The trained networks and fitted filters that are shipped, `<estimator>_<condition>.onnx|npz`,
each network beside its model card. `sensor.estimators` opens them.
"""
