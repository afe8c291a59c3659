//! The registry of formats, in the help and in the documentation.

use sonard::import::FORMATS;

use super::{done, refused};

#[test]
fn formats_are_documented() {
    let page = include_str!("../../../docs/import.md");
    let help = done(&["import", "--help"]);
    for entry in &FORMATS {
        let row = format!("| `{}` | {} |", entry.name, entry.about);
        assert!(page.contains(&row), "docs/import.md lacks {row}");
        assert!(help.contains(&format!("- {}:", entry.name)), "{}: {help}", entry.name);
    }
    let rows = page
        .lines()
        .filter(|line| line.starts_with("| `") && !line.contains("--") && !line.contains("scene "));
    assert_eq!(
        rows.count(),
        FORMATS.len(),
        "docs/import.md has rows of formats that there are not"
    );
    assert!(refused(&["import", "/dev/null", "--format", "excel"]).contains("ros_text"));
}

#[test]
fn unsupported_files() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes, what, way) in [
        ("a.bag", &b"#ROSBAG V2.0\nE\0\0\0op=\x03"[..], "ROS 1", "rosbags-convert"),
        ("a.npy", b"\x93NUMPY\x01\0v\0", "NumPy", "np.savetxt"),
        ("a.xlsx", b"PK\x03\x04\x14\0[Content_Types].xml\0", "spreadsheet", "CSV"),
        ("a.world", b"window\n(\n  size [ 1 1 ]\n)\nfloorplan\n(\n)\n", "Stage", "Player"),
        ("a.sdf", b"<sdf version='1.9'><world/></sdf>", "Gazebo", "scene from-sdf"),
        (
            "a.yaml",
            b"image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n",
            "map",
            "scene from-grid",
        ),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("writes");
        let message = refused(&["import", path.to_str().expect("a plain path")]);
        assert!(message.contains(what) && message.contains(way), "{name}: {message}");
    }
}
