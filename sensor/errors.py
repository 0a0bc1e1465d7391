"""The one exception that users of the sensor package see."""


class SensorError(ValueError):
    """A network, data file, recipe or sample that does not fit; its message is one sentence for
    each problem.
    """
