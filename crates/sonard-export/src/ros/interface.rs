//! Message types as declared in a recording: name, definition and hash.

/// Message type with its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Interface {
    /// Type name, as `package/msg/Type`.
    pub(crate) name: &'static str,
    /// Hash of the definition, as computed by ROS 2 since Iron (REP 2016).
    pub(crate) hash: &'static str,
    definition: &'static str,
    /// Nested types, the outermost first.
    parts: &'static [(&'static str, &'static str)],
}

impl Interface {
    /// Returns the definition with those of nested types, in the schema encoding `ros2msg`.
    pub(crate) fn definition(&self) -> String {
        let rule = "=".repeat(80);
        let parts = self.parts.iter();
        let parts = parts.map(|(name, definition)| format!("{rule}\nMSG: {name}\n{definition}"));
        [self.definition.to_owned()].into_iter().chain(parts).collect()
    }
}

pub(crate) const RANGE: Interface = Interface {
    name: "sensor_msgs/msg/Range",
    hash: "RIHS01_b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a",
    definition: "\
uint8 ULTRASOUND=0
uint8 INFRARED=1
std_msgs/Header header
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
float32 variance
",
    parts: &[HEADER, TIME],
};

/// `sensor_msgs/Range` of Humble and earlier.
pub(crate) const RANGE_HUMBLE: Interface = Interface {
    name: "sensor_msgs/msg/Range",
    hash: "RIHS01_9430b1915b94d4268ff903679e8ecd09b6a67d331bd028738ec1eeb592891ebd",
    definition: "\
uint8 ULTRASOUND=0
uint8 INFRARED=1
std_msgs/Header header
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
",
    parts: &[HEADER, TIME],
};

pub(crate) const FLOAT: Interface = Interface {
    name: "std_msgs/msg/Float64",
    hash: "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
    definition: "float64 data\n",
    parts: &[],
};

pub(crate) const LASER_SCAN: Interface = Interface {
    name: "sensor_msgs/msg/LaserScan",
    hash: "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    definition: "\
std_msgs/Header header
float32 angle_min
float32 angle_max
float32 angle_increment
float32 time_increment
float32 scan_time
float32 range_min
float32 range_max
float32[] ranges
float32[] intensities
",
    parts: &[HEADER, TIME],
};

pub(crate) const POINT_CLOUD: Interface = Interface {
    name: "sensor_msgs/msg/PointCloud2",
    hash: "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    definition: "\
std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
",
    parts: &[
        HEADER,
        TIME,
        (
            "sensor_msgs/PointField",
            "\
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
",
        ),
    ],
};

pub(crate) const OCCUPANCY_GRID: Interface = Interface {
    name: "nav_msgs/msg/OccupancyGrid",
    hash: "RIHS01_8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    definition: "\
std_msgs/Header header
nav_msgs/MapMetaData info
int8[] data
",
    parts: &[
        HEADER,
        TIME,
        (
            "nav_msgs/MapMetaData",
            "\
builtin_interfaces/Time map_load_time
float32 resolution
uint32 width
uint32 height
geometry_msgs/Pose origin
",
        ),
        POSE,
        POINT,
        QUATERNION,
    ],
};

pub(crate) const TRANSFORMS: Interface = Interface {
    name: "tf2_msgs/msg/TFMessage",
    hash: "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    definition: "geometry_msgs/TransformStamped[] transforms\n",
    parts: &[
        (
            "geometry_msgs/TransformStamped",
            "\
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
",
        ),
        HEADER,
        TIME,
        (
            "geometry_msgs/Transform",
            "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        ),
        VECTOR,
        QUATERNION,
    ],
};

pub(crate) const MARKERS: Interface = Interface {
    name: "visualization_msgs/msg/MarkerArray",
    hash: "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    definition: "visualization_msgs/Marker[] markers\n",
    parts: &[
        ("visualization_msgs/Marker", MARKER),
        HEADER,
        TIME,
        POSE,
        POINT,
        QUATERNION,
        VECTOR,
        ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
        ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
        ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
        ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
        ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n"),
    ],
};

const HEADER: (&str, &str) =
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const POSE: (&str, &str) =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const VECTOR: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");

const MARKER: &str = "\
int32 ARROW=0
int32 CUBE=1
int32 SPHERE=2
int32 CYLINDER=3
int32 LINE_STRIP=4
int32 LINE_LIST=5
int32 CUBE_LIST=6
int32 SPHERE_LIST=7
int32 POINTS=8
int32 TEXT_VIEW_FACING=9
int32 MESH_RESOURCE=10
int32 TRIANGLE_LIST=11
int32 ARROW_STRIP=12
int32 ADD=0
int32 MODIFY=0
int32 DELETE=2
int32 DELETEALL=3
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials
";
