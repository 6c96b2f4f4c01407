"""What the toolkit may need, and how it is got where no extra brings it."""

from simbase.installation import Need

NEEDS = (
    Need(name="pyserial", kind="package", feature="serial ports"),
    Need(name="construct", kind="package", feature="the P2OS protocol"),
    Need(name="pybullet", kind="package", feature="--body bullet", extra="bullet"),
    Need(name="mujoco", kind="package", feature="--body mujoco", extra="mujoco"),
    Need(name="numpy", kind="package", feature="--body bullet, --body mujoco", extra="columns"),
    Need(name="pyarrow", kind="package", feature="export to Parquet and Arrow", extra="export"),
    Need(name="mcap", kind="package", feature="export to MCAP", extra="export"),
    Need(name="cyclonedds", kind="package", feature="ros, run --ros by DDS", extra="ros"),
    Need(name="eclipse-zenoh", kind="package", feature="ros, run --ros by zenoh", extra="ros"),
    Need(name="rosbags", kind="package", feature="rosbag2, both ways", extra="ros"),
    Need(name="pillow", kind="package", feature="worlds from ROS maps: pictures", extra="worlds"),
    Need(name="pyyaml", kind="package", feature="worlds from ROS maps", extra="worlds"),
    Need(name="pygame-ce", kind="package", feature="teleop --pad", extra="pad"),
    Need(name="starlette", kind="package", feature="view, --view", extra="view"),
    Need(name="uvicorn", kind="package", feature="view, --view", extra="view"),
    Need(name="websockets", kind="package", feature="view, --view", extra="view"),
    Need(
        name="physics",
        kind="plug-in",
        feature="--body bullet, mujoco, tcp:, unix:",
        points=("p2os.bodies", "p2os.body_addresses"),
        point="bullet",
    ),
    Need(
        name="world files",
        kind="plug-in",
        feature="worlds of .sdf, .urdf, .obj",
        points=("p2os.world_readers",),
        point="sdf",
    ),
    Need(name="ROS", kind="plug-in", feature="ros", points=("p2os.verbs",), point="ros"),
    Need(
        name="page",
        kind="plug-in",
        feature="view, --view",
        points=("p2os.view_servers",),
        point="page",
    ),
    Need(name="tshark", kind="program", feature="captures on the command line", get="sudo apt-get install tshark"),
)
