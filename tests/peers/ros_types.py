"""The published types of ROS 2, as Cyclone DDS declares them: written from the definitions of ROS 2, not from sonard."""

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, float32, float64, int8, int32, int64, sequence, uint8, uint32, uint64


def name(text):
    """As `sensor_msgs/msg/Range` is called on the wire."""
    package, kind, short = text.split("/")
    return f"{package}::{kind}::dds_::{short}_"


@dataclass
@final
class Time(IdlStruct, typename=name("builtin_interfaces/msg/Time")):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Duration(IdlStruct, typename=name("builtin_interfaces/msg/Duration")):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename=name("std_msgs/msg/Header")):
    stamp: Time
    frame_id: str


@dataclass
@final
class Float64(IdlStruct, typename=name("std_msgs/msg/Float64")):
    data: float64


@dataclass
@final
class Range(IdlStruct, typename=name("sensor_msgs/msg/Range")):
    header: Header
    radiation_type: uint8
    field_of_view: float32
    min_range: float32
    max_range: float32
    range: float32
    variance: float32


@dataclass
@final
class RangeOfHumble(IdlStruct, typename=name("sensor_msgs/msg/Range")):
    header: Header
    radiation_type: uint8
    field_of_view: float32
    min_range: float32
    max_range: float32
    range: float32


@dataclass
@final
class LaserScan(IdlStruct, typename=name("sensor_msgs/msg/LaserScan")):
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]
    intensities: sequence[float32]


@dataclass
@final
class PointField(IdlStruct, typename=name("sensor_msgs/msg/PointField")):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
@final
class PointCloud2(IdlStruct, typename=name("sensor_msgs/msg/PointCloud2")):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
@final
class Vector3(IdlStruct, typename=name("geometry_msgs/msg/Vector3")):
    x: float64
    y: float64
    z: float64


@dataclass
@final
class Point(IdlStruct, typename=name("geometry_msgs/msg/Point")):
    x: float64
    y: float64
    z: float64


@dataclass
@final
class Quaternion(IdlStruct, typename=name("geometry_msgs/msg/Quaternion")):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
@final
class Pose(IdlStruct, typename=name("geometry_msgs/msg/Pose")):
    position: Point
    orientation: Quaternion


@dataclass
@final
class PoseWithCovariance(IdlStruct, typename=name("geometry_msgs/msg/PoseWithCovariance")):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
@final
class PoseWithCovarianceStamped(IdlStruct, typename=name("geometry_msgs/msg/PoseWithCovarianceStamped")):
    header: Header
    pose: PoseWithCovariance


@dataclass
@final
class MapMetaData(IdlStruct, typename=name("nav_msgs/msg/MapMetaData")):
    map_load_time: Time
    resolution: float32
    width: uint32
    height: uint32
    origin: Pose


@dataclass
@final
class OccupancyGrid(IdlStruct, typename=name("nav_msgs/msg/OccupancyGrid")):
    header: Header
    info: MapMetaData
    data: sequence[int8]


@dataclass
@final
class Transform(IdlStruct, typename=name("geometry_msgs/msg/Transform")):
    translation: Vector3
    rotation: Quaternion


@dataclass
@final
class TransformStamped(IdlStruct, typename=name("geometry_msgs/msg/TransformStamped")):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
@final
class TFMessage(IdlStruct, typename=name("tf2_msgs/msg/TFMessage")):
    transforms: sequence[TransformStamped]


@dataclass
@final
class ColorRGBA(IdlStruct, typename=name("std_msgs/msg/ColorRGBA")):
    r: float32
    g: float32
    b: float32
    a: float32


@dataclass
@final
class CompressedImage(IdlStruct, typename=name("sensor_msgs/msg/CompressedImage")):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
@final
class UVCoordinate(IdlStruct, typename=name("visualization_msgs/msg/UVCoordinate")):
    u: float32
    v: float32


@dataclass
@final
class MeshFile(IdlStruct, typename=name("visualization_msgs/msg/MeshFile")):
    filename: str
    data: sequence[uint8]


@dataclass
@final
class Marker(IdlStruct, typename=name("visualization_msgs/msg/Marker")):
    header: Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: sequence[Point]
    colors: sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@dataclass
@final
class MarkerArray(IdlStruct, typename=name("visualization_msgs/msg/MarkerArray")):
    markers: sequence[Marker]


@dataclass
@final
class Gid(IdlStruct, typename=name("rmw_dds_common/msg/Gid")):
    data: array[uint8, 16]


@dataclass
@final
class NodeEntitiesInfo(IdlStruct, typename=name("rmw_dds_common/msg/NodeEntitiesInfo")):
    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
@final
class ParticipantEntitiesInfo(IdlStruct, typename=name("rmw_dds_common/msg/ParticipantEntitiesInfo")):
    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


@dataclass
@final
class GidOfHumble(IdlStruct, typename=name("rmw_dds_common/msg/Gid")):
    data: array[uint8, 24]


@dataclass
@final
class NodeOfHumble(IdlStruct, typename=name("rmw_dds_common/msg/NodeEntitiesInfo")):
    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[GidOfHumble]
    writer_gid_seq: sequence[GidOfHumble]


@dataclass
@final
class ParticipantOfHumble(IdlStruct, typename=name("rmw_dds_common/msg/ParticipantEntitiesInfo")):
    gid: GidOfHumble
    node_entities_info_seq: sequence[NodeOfHumble]


@dataclass
@final
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    """With the header that rmw_cyclonedds puts before the fields, of which there are none."""

    guid: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
@final
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    guid: uint64
    number: int64
    success: bool
    message: str
