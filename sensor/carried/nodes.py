"""The nodes of the streaming graph, in the order in which a sample goes through them: residuals,
slow means, delay line, features, network. Names of constants are those of `sensor.carried.graph`.
"""

from typing import Any

from onnx import NodeProto, TensorProto, helper


def nodes(units: int) -> list[NodeProto]:
    """Return all nodes of a network with `units` units in its LSTM."""
    return [*_residual(), *_slow(), *_delay(), *_assembled(), *_recurrent(units)]


def _node(kind: str, inputs: str, output: str, **attributes: Any) -> NodeProto:
    return helper.make_node(kind, inputs.split(), output.split(), **attributes)


def _residual() -> list[NodeProto]:
    """Wheel-speed residuals: `sensor.features`, in double precision, as they are small differences
    of large speeds; cos x = 1 - 2 sin(x/2)^2 keeps its digits with a sine in single precision.
    """
    double = TensorProto.DOUBLE
    return [
        _node("Gather", "measured i_ax", "ax", axis=1),
        _node("Gather", "measured i_ay", "ay", axis=1),
        _node("Gather", "measured i_yaw", "yaw", axis=1),
        _node("Gather", "measured i_vx", "vx", axis=1),
        _node("Gather", "measured i_road_wheels", "road_wheels", axis=1),
        _node("Mul", "road_wheels half", "half_angles"),
        _node("Sin", "half_angles", "half_sines"),
        _node("Cast", "half_sines", "half_sines_64", to=double),
        _node("Mul", "half_sines_64 half_sines_64", "half_squares"),
        _node("Mul", "half_squares two_64", "versines"),
        _node("Sub", "one_64 versines", "cosines"),
        _node("Concat", "cosines ones_64", "headings", axis=1),
        _node("Cast", "measured", "measured_64", to=double),
        _node("Gather", "measured_64 i_ax", "ax_64", axis=1),
        _node("Gather", "measured_64 i_ay", "ay_64", axis=1),
        _node("Gather", "measured_64 i_yaw", "yaw_64", axis=1),
        _node("Gather", "measured_64 i_vx", "vx_64", axis=1),
        _node("Gather", "measured_64 i_wheel_speeds", "wheel_speeds", axis=1),
        _node("Mul", "yaw_64 wheel_y", "turning"),
        _node("Sub", "vx_64 turning", "forward"),
        _node("Div", "forward headings", "rolling"),
        _node("Mul", "ax_64 per_ax", "slip_x"),
        _node("Mul", "ay_64 per_ay", "slip_y"),
        _node("Add", "slip_x slip_y", "slip_xy"),
        _node("Add", "slip_xy axle", "slip"),
        _node("Mul", "rolling slip", "driving"),
        _node("Sub", "wheel_speeds driving", "left_over_64"),
        _node("Cast", "left_over_64", "left_over", to=TensorProto.FLOAT),
        _node("Clip", "left_over residual_least residual_most", "residual"),
    ]


def _slow() -> list[NodeProto]:
    """Slow means and leaky integrals."""
    return [
        _node("Max", "vx least_speed", "speed"),
        _node("Add", "samples one", "next_samples"),
        _node("Add", "next_samples zeros_before", "all_samples"),
        _node("Div", "one all_samples", "part_of_all"),
        _node("Max", "part_of_all slowest_rates", "all_rates"),
        _node("Split", "all_rates rate_split", "rates energy_rate", axis=1),
        _node("Div", "residual speed", "relative"),
        _node("Clip", "relative slip_least slip_most", "relative_clipped"),
        _node("Gather", "measured i_free", "imu", axis=1),
        _node("Concat", "relative_clipped imu", "slow_sample", axis=1),
        _node("Sub", "slow_sample means", "news"),
        _node("Mul", "news rates", "taken_over"),
        _node("Add", "means taken_over", "next_means"),
        _node("Split", "next_means mean_split", "mean_slip mean_imu", axis=1),
        _node("Mul", "mean_slip speed", "slow_residual"),
        _node("Sub", "residual slow_residual", "wheel"),
        _node("Sub", "imu mean_imu", "free"),
        _node("Mul", "integrals integral_keep", "kept"),
        _node("Mul", "free sample_time", "gained"),
        _node("Add", "kept gained", "next_integrals"),
    ]


def _delay() -> list[NodeProto]:
    """The delay line, and what it held one wheelbase ago."""
    return [
        _node("Concat", "wheel free ax ay yaw", "source", axis=1),
        _node("Gather", "line first_row", "before", axis=0),
        _node("Gather", "line second_row", "before_that", axis=0),
        _node("Sub", "source before", "difference"),
        _node("Sub", "before before_that", "difference_before"),
        _node("Sub", "difference difference_before", "second_difference"),
        _node("Slice", "line line_first line_last", "line_kept"),
        _node("Concat", "source line_kept", "next_line", axis=0),
        _node("Div", "free typical", "level_parts"),
        _node("Mul", "level_parts level_parts", "level_squares"),
        _node("ReduceMean", "level_squares", "energy_now", axes=[1], keepdims=1),
        _node("Sub", "energy_now energy", "energy_news"),
        _node("Mul", "energy_news energy_rate", "energy_gained"),
        _node("Add", "energy energy_gained", "next_energy"),
        _node("Add", "next_energy least_energy", "energy_kept_up"),
        _node("Sqrt", "energy_kept_up", "level"),
        _node("Div", "wheelbase_samples speed", "delay"),
        _node("Sub", "delay leads", "age_free"),
        _node("Clip", "age_free age_least age_most", "age"),
        _node("Floor", "age", "age_whole"),
        _node("Sub", "age age_whole", "age_part"),
        _node("Reshape", "age_part column", "part"),
        *_lagrange(),
        _node("Reshape", "age_whole flat", "number_real"),
        _node("Cast", "number_real", "number", to=TensorProto.INT64),
        _node("Sub", "number one_row", "number_before"),
        _node("Max", "number_before no_row", "newer"),
        _node("Add", "number one_row", "older"),
        _node("Add", "number two_rows", "oldest"),
        _node("Gather", "next_line i_delayed", "delayed_signals", axis=1),
        *(
            node
            for place, row in enumerate(("newer", "number", "older", "oldest"))
            for node in (
                _node("Gather", f"delayed_signals {row}", f"rows{place}", axis=0),
                _node("Mul", f"rows{place} weight{place}", f"share{place}"),
            )
        ),
        _node("Sum", "share0 share1 share2 share3", "delayed_rows"),
        _node("Reshape", "delayed_rows row", "delayed"),
    ]


def _lagrange() -> list[NodeProto]:
    """Weights of four neighbouring samples: `sensor.carried.features.lagrange`."""
    return [
        _node("Add", "part one", "p_after"),
        _node("Sub", "one part", "p_rest"),
        _node("Sub", "two part", "p_rest2"),
        _node("Mul", "part p_rest", "p01"),
        _node("Mul", "p01 p_rest2", "p012"),
        _node("Div", "p012 minus_six", "weight0"),
        _node("Mul", "p_after p_rest", "q01"),
        _node("Mul", "q01 p_rest2", "q012"),
        _node("Div", "q012 two", "weight1"),
        _node("Mul", "p_after part", "r01"),
        _node("Mul", "r01 p_rest2", "r012"),
        _node("Div", "r012 two", "weight2"),
        _node("Mul", "r01 p_rest", "s012"),
        _node("Div", "s012 minus_six", "weight3"),
    ]


def _assembled() -> list[NodeProto]:
    """All features in their order, standardised."""
    return [
        _node("Div", "vx speed_unit", "vx_feature"),
        _node("Div", "slowness_unit speed", "slowness"),
        _node("Log", "level", "log_level"),
        _node("Gather", "measured i_steer", "steer", axis=1),
        _node(
            "Concat",
            "wheel free next_integrals difference second_difference delayed",
            "moving",
            axis=1,
        ),
        _node("Div", "moving level", "moving_level"),
        _node("Div", "moving_level moving_scales", "moving_free"),
        _node("Clip", "moving_free moving_least moving_most", "moving_clipped"),
        _node(
            "Concat",
            "ax ay yaw vx_feature slowness log_level steer command moving_clipped",
            "features",
            axis=1,
        ),
        _node("Sub", "features mean", "centred"),
        _node("Div", "centred std", "standardised"),
    ]


def _recurrent(units: int) -> list[NodeProto]:
    """Dense layer, one step of the LSTM, the outputs."""
    return [
        _node("Gemm", "standardised front_W front_B", "front_sum", transB=1),
        _node("Tanh", "front_sum", "front"),
        _node("Unsqueeze", "front first_axis", "front_step"),
        helper.make_node(
            "LSTM",
            ["front_step", "lstm_W", "lstm_R", "lstm_B", "", "hidden", "cell"],
            ["", "next_hidden", "next_cell"],
            hidden_size=units,
        ),
        _node("Squeeze", "next_hidden first_axis", "ahead"),
        _node("Gemm", "ahead hidden_W hidden_B", "hidden_sum", transB=1),
        _node("Relu", "hidden_sum", "hidden_layer"),
        _node("Gemm", "hidden_layer output_W output_B", "bent", transB=1),
        _node("Gemm", "standardised straight_W", "straight", transB=1),
        _node("Add", "bent straight", "velocity"),
        _node("Mul", "velocity scale", "velocity_scaled"),
        _node("Mul", "velocity_scaled level", "estimate"),
        _node("Gemm", "hidden_layer deviation_W deviation_B", "deviation_sum", transB=1),
        _node("Clip", "deviation_sum deviation_least deviation_most", "log_deviation"),
        _node("Exp", "log_deviation", "deviation_ratio"),
        _node("Mul", "deviation_ratio deviation_scale", "deviation_scaled"),
        _node("Mul", "deviation_scaled level", "deviation"),
    ]
