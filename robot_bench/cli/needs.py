"""What the bench may need, and how it is got where no extra brings it."""

from simbase.installation import Need

NEEDS = (
    Need(name="matplotlib", kind="package", feature="plots of a run", extra="sim"),
    Need(name="scipy", kind="package", feature="compare, fit, metrics; campaign", extra="experiments"),
    Need(name="SALib", kind="package", feature="sensitivity", extra="experiments"),
    Need(name="optuna", kind="package", feature="campaign: search by samplers", extra="campaign"),
    Need(name="ribs", kind="package", feature="campaign: quality and diversity", extra="campaign"),
    Need(name="dask", kind="package", feature="campaign --dask", extra="campaign"),
    Need(name="distributed", kind="package", feature="campaign --dask", extra="campaign"),
    Need(name="foxglove-sdk", kind="package", feature="run --foxglove", extra="foxglove"),
    Need(
        name="ROS bench",
        kind="plug-in",
        feature="run --ros, report --ros2",
        point="ros",
        points=("robot_bench.networks", "robot_bench.bags", "robot_bench.drive_readers"),
    ),
    Need(name="board test", kind="plug-in", feature="board", points=("p2os.verbs",), point="board"),
    Need(
        name="studies",
        kind="plug-in",
        feature="campaign, compare, fit, explain",
        points=("robot_bench.explainers", "p2os.view_sources"),
        point="explain",
    ),
    Need(name="robot_bench._edges", kind="built", feature="wires of a run"),
    Need(name="robot_bench._esp32", kind="built", feature="board test --emulated"),
    Need(name="robot_bench._esp32_rev_c", kind="built", feature="board test --emulated, rev C"),
    Need(name="robot_bench._adapter_firmware", kind="built", feature="--adapter firmware"),
    Need(name="sigrok-cli", kind="program", feature="reading pins.sr of a run", get="sudo apt-get install sigrok-cli"),
)
